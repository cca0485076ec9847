"""Mending seams in the window: the question, the running job, and the result."""
