"""Background training: one process per clip, messages, snapshots."""
