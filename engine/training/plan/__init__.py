"""A clip's training before it begins: sizes with reasons, and a forecast from timed steps."""
