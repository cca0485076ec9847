"""The document on disk: journal, history, recovery."""
