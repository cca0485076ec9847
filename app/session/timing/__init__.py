"""The timing of the take."""
