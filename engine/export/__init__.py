"""Export: scenes in the file formats of other programs."""
