"""Finding an action by its name: the palette."""
