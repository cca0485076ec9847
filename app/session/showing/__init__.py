"""The shown picture, and everything that prepares it."""
