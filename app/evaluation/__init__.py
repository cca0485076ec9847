"""Figures of trained projects, measured once and kept."""
