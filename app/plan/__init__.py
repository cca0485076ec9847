"""What training the next clips would take."""
