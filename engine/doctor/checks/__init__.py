"""The checks: one file each, with a function that takes its inputs and returns findings."""
