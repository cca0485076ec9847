"""Edits applied permanently: clips are written again without what edits have deleted."""
