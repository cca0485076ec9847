"""The window around the panels: frame loop, events, dialogs, layout."""
