"""What is shown, and from where."""
