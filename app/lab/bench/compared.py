"""The back ends that are measured side by side, and the one that all of them are compared with."""

from __future__ import annotations

import torch

from engine.backends.backend import Backend
from engine.backends.reference.backend import ReferenceBackend
from engine.backends.table import backend_called

COMPARED: dict[str, Backend] = {name: backend_called(name) for name in ("cpu", "reference")}
"""The back end that a training uses by default, and plain torch; both in float32."""
FAST = COMPARED["cpu"]
EXACT: Backend = ReferenceBackend(dtype=torch.float64)
"""The slow truth."""
