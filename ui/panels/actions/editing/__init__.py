"""What the user draws, selects and edits."""
