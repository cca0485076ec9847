"""The viewport's drawing, and the things under the pointer."""
