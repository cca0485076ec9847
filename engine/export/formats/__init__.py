"""File formats: one file each, with `write(splats, file)` and `read(file)`; see table.py."""
