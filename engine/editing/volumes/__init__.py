"""Volumes: prisms, volumes that move from key to key, and those that follow an object."""
