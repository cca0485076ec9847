"""Checkpoints with one thing wrong each, for the tests of what refuses them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import to_builtins

from engine.clip_files.clip_state import ClipState
from tests.clip_headers import write_values


def damaged_states(state: ClipState) -> dict[str, Callable[[Path], None]]:
    """A checkpoint as versions without checksums could have left it, with one thing wrong each. Each writes itself."""
    arrays, header = state.arrays, to_builtins(state.header, builtin_types=())
    resume = header["resume"]
    moment = next(name for name in arrays if name.endswith(".exp_avg"))
    gains = arrays["resume.gains"]
    own = {name: array for name, array in arrays.items() if name != "resume.shared"}
    images, stable = np.zeros((len(gains), 8, 16, 3), np.uint8), np.zeros((len(gains), 8, 2), np.uint8)
    damaged: dict[str, tuple[dict[str, np.ndarray], dict[str, Any]]] = {
        "not JSON": (arrays, header | {"resume": "{"}),
        "no place": (arrays, {name: value for name, value in header.items() if name != "resume"}),
        "list": (arrays, header | {"resume": []}),
        "phase 99": (arrays, header | {"resume": resume | {"phase_index": 99}}),
        "words for steps": (arrays, header | {"resume": resume | {"steps_in_phase": "many"}}),
        "no order": (arrays, header | {"resume": resume | {"order": {}}}),
        "no random numbers": (arrays, header | {"resume": resume | {"generator": [1, 2]}}),
        "no gains": ({name: array for name, array in arrays.items() if name != "resume.gains"}, header),
        "gains of others": (arrays | {"resume.gains": gains[:2]}, header),
        "gains NaN": (arrays | {"resume.gains": gains * np.float32("nan")}, header),
        "turned pictures": (
            own | {"resume.backgrounds": images.swapaxes(1, 2), "resume.is_stable": stable},
            header,
        ),
        "no backgrounds": ({name: a for name, a in own.items() if name != "resume.backgrounds"}, header),
        "backgrounds of others": (own | {"resume.shared": np.zeros(8, np.uint8)}, header),
        "short moments": (arrays | {moment: arrays[moment].reshape(-1)[:1]}, header),
        "no anchors": ({name: a for name, a in arrays.items() if "residual.positions" not in name}, header),
        "no spacing": (arrays, {name: value for name, value in header.items() if name != "spacing"}),
    }
    return {name: partial(write_values, arrays=kept, values=values) for name, (kept, values) in damaged.items()}
