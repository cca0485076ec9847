"""Objects of a project, found in its clips."""
