"""One reader per layout on disk: probe(folder), read(folder)."""
