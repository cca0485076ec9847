"""Actions that draw, select and edit."""
