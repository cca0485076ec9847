"""The document of a project: everything that a user decides about it, as one value with a history, and its files."""
