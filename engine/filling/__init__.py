"""Fill what was behind something that an edit takes away: find its traces, and continue surfaces that nobody saw."""
