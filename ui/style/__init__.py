"""Colours, fonts, sizes and words that all of the window shares."""
