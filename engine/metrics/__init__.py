"""Figures of rendered pictures, and what changes between clips."""
