"""Mending seams in the window: what is asked, the job that runs, and what came of it."""
