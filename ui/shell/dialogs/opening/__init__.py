"""Questions and messages when a folder is opened."""
