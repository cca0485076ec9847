"""The static scene as points: plane sweeps over the backgrounds."""
