"""The checks: one file each, with a function that takes what it needs and returns findings."""
