"""Where panels are, and what the window remembers of that."""
