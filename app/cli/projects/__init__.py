"""Commands that change a project or say what is in it."""
