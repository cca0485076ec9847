"""What was mended in a project: a record of each time, and clips that are put in place or taken back together."""
