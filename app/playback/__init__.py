"""Everything that prepares contents for the screen: frames, pictures, clouds, views."""
