"""A project's disk use, and making room on the disk."""
