"""Objects of the open project: made, corrected, looked for, and followed by volumes."""
