"""The residuals panel: how far every picture is from its camera's picture, and where clips do not meet."""
