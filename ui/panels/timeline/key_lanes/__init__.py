"""Lanes with keys: of the camera path, and of the volume that the chosen edit acts on."""
