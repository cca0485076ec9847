"""Several clips in training at once: what they share."""
