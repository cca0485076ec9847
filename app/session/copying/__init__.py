"""What was done, or could be done, as commands to copy."""
