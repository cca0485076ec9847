"""Everything that prepares what is shown: frames, pictures, clouds, views."""
