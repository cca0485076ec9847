"""The edits that go along with an export."""
