"""Output for a terminal: progress, results, and nothing that could command it."""
