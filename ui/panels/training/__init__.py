"""Panels of training: progress, plan, queue, curves, and the quality and versions of clips."""
