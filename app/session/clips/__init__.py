"""The clips of the open project as a user deals with them: dependencies, versions, room on the disk."""
