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
    gains, images = arrays["resume.gains"], arrays["resume.backgrounds"]
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
        "turned pictures": (arrays | {"resume.backgrounds": images.swapaxes(1, 2)}, header),
        "short moments": (arrays | {moment: arrays[moment].reshape(-1)[:1]}, header),
        "no anchors": ({name: a for name, a in arrays.items() if "residual.positions" not in name}, header),
        "no spacing": (arrays, {name: value for name, value in header.items() if name != "spacing"}),
    }
    return {name: partial(write_values, arrays=kept, values=values) for name, (kept, values) in damaged.items()}
