"""The parts of one training step, apart from decoding and drawing."""
