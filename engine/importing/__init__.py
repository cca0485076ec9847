"""Scenes of other programs: reading them frame by frame, and storing them as clips."""
