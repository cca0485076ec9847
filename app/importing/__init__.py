"""A scene of another program becomes a project."""
