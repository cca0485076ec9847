"""A player for a browser: the scene in a few bytes, and the page that shows it. Its layout: docs/player_format.md."""
