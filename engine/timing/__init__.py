"""How a take plays: which frames of the capture come when, how fast, which way and how often."""
