"""Differences of a trained clip from the captured pictures and from its neighbours: maps, figures, seams."""
