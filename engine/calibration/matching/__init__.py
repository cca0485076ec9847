"""Key points of cameras, and which of them look alike."""
