"""Where panels are, and the window's memory of that."""
