"""Training while the capture is still being recorded."""
