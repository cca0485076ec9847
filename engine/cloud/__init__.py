"""Points from pictures, with numpy and numba only."""
