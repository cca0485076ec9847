"""clipgstream report: one page about a project."""
