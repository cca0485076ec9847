"""Every point of the published method, in one tuple.

The preset follows the paper where the paper says something, and the released code where it does not. Each remaining
difference is a point with a reason. The tables of docs/method.md are generated from here, and tests compare every point
with the preset and with the code.
"""

from __future__ import annotations

from engine.training.published.clouds import CLOUDS
from engine.training.published.model import MODEL
from engine.training.published.point import Point
from engine.training.published.training import TRAINING

POINTS: tuple[Point, ...] = (*MODEL, *CLOUDS, *TRAINING)
"""Every point, in the order of the tables."""
