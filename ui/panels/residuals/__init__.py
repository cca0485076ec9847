"""The residuals panel: how far every picture is from what its camera took, and where clips do not meet."""
