"""Files of a capture: what a folder holds, which files are frames, videos and sound."""
