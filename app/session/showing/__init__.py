"""What the user looks at, and what prepares it."""
