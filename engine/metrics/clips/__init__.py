"""Figures of trained clips: every frame against every camera, and the seams between clips."""
