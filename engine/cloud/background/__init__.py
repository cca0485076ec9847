"""What each camera sees when nothing moves."""
