"""The panel of the capture doctor: findings, what to look at, and where the cameras stand."""
