"""Encoders: pictures to files, one file per format."""
