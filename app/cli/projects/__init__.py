"""Commands that change a project or list its contents."""
