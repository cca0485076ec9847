"""What a terminal shows: progress, results, and nothing that could command it."""
