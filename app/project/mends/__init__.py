"""Mends of a project: a record of each, and clips that are put in place or taken back together."""
