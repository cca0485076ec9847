"""Opening and starting projects, and what the window remembers of them."""
