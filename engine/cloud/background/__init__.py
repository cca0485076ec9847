"""The background of each camera: its picture when nothing moves."""
