"""Commands about captures."""
