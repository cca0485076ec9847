"""The panel of the capture doctor: findings, their evidence, and where the cameras stand."""
