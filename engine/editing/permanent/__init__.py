"""Deleting for good: which anchors no frame shows any more, and clips without them."""
