"""Opening a folder: its kind, the questions to the user, and the project made or found."""
