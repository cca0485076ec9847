"""The rows of the timeline, from the overview to the lanes, and what is known of clips as columns."""
