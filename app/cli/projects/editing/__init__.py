"""The commands that edit a project: edits, objects, copies, the time of the take."""
