"""What the viewport draws and what lies under the pointer."""
