"""Actions on content and viewpoint of the picture."""
