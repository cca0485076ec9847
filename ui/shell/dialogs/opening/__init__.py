"""What is asked and said when a folder is opened."""
