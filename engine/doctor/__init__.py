"""The capture doctor: looks at a capture before anything is trained, and reports its problems and their remedies."""
