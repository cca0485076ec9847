"""Where a trained clip differs from what the cameras took, and from its neighbours: maps, figures, seams."""
