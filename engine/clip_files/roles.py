"""Roles of anchor sets, in the order in which they are decoded. Plain values, for whoever shows them."""

from __future__ import annotations

STATIC = "static"
ROLES = (STATIC, "moving", "promoted", "residual", "adapted", "replacing")
"""static: no dynamic feature. moving: on the hulls of the reference clip. promoted: static in space, changing in the
reference clip, as under a lamp. residual: what a source clip adds. adapted: moving ones that keep
learning in a source clip. replacing: promoted in a source clip, in place of static ones."""

REFERENCE_ROLES = (STATIC, "moving", "promoted")
"""Those that a source clip inherits from its reference clip."""
