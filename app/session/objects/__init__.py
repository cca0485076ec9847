"""Objects of the open project: made, corrected and looked for."""
