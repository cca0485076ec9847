"""The readable back end: plain torch on any device and in any floating dtype; what the others are tested against."""
