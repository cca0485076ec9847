"""The state of the window: commands in, status out."""
