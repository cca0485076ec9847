"""What the user edits: the document of the open project, its history, and what is selected."""
