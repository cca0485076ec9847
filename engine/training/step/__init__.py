"""What one training step consists of, beside decoding and drawing."""
