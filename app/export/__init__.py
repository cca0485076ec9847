"""Exports: what leaves a project for other programs. Jobs without a window, which print nothing."""
