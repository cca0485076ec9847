"""One clip in the panels: what it depends on, its versions, and the room that it takes."""
