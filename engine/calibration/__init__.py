"""Cameras of a folder of plain videos: lenses, places and directions, found from what the videos show."""
