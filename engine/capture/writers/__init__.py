"""One writer per layout on disk, each the other way round of its reader."""
