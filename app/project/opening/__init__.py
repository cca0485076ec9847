"""What opening a folder means: what it is, what is asked, and the project made or found."""
