"""The clips of the open project as a user deals with them: what depends on what, versions, room on the disk."""
