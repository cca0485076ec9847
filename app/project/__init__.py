"""The project folder: settings, clips, lock, recent projects."""
