"""Anchors, field, decoder, and a clip made of them."""
