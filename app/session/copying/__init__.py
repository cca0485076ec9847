"""Steps, done or possible, as commands to copy."""
