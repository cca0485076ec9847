"""The start of a clip's training: pictures, clouds, anchors, field."""
