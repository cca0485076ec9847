"""One clip, step by step; no loop, no file names."""
