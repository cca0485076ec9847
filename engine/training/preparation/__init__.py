"""What a clip's training starts from: pictures, clouds, anchors, field."""
