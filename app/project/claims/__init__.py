"""Which process trains which clip of a project, on whatever computer. Claims need no locks of the file system."""
