"""Fills of edits: packed for a document, and shown in the place of what an edit takes away."""
