"""Pictures of a trained scene as videos and as sequences of image files."""
