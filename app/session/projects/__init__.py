"""Opening and starting projects, and the window's memory of them."""
