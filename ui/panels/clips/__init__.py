"""One clip in the panels: its dependencies, its versions, and the room that it takes."""
