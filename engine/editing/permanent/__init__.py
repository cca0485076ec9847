"""Deleting for good: which anchors no frame shows now, and clips without them."""
