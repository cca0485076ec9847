"""What a project takes on the disk, and making room there."""
