"""Steps done in the window as text: a line for a shell, and a few lines of Python."""
