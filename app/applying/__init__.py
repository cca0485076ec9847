"""Edits applied permanently: clips are written again without deleted anchors."""
