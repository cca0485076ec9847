"""Figures of one picture against another."""
