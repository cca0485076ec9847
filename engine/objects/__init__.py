"""Objects: people and things found again in every clip."""
