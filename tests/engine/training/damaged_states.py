"""Checkpoints with one thing wrong each, for the tests of what refuses them."""

from __future__ import annotations

import numpy as np

from engine.clip_files.clip_state import ClipState


def damaged_states(state: ClipState) -> dict[str, ClipState]:
    """A checkpoint as versions without checksums could have left it, with one thing wrong each."""
    arrays, header, resume = state.arrays, state.header, state.header["resume"]
    moment = next(name for name in arrays if name.endswith(".exp_avg"))
    gains, images = arrays["resume.gains"], arrays["resume.backgrounds"]
    return {
        "not JSON": ClipState(arrays, header | {"resume": "{"}),
        "no place": ClipState(arrays, {name: value for name, value in header.items() if name != "resume"}),
        "list": ClipState(arrays, header | {"resume": []}),
        "phase 99": ClipState(arrays, header | {"resume": resume | {"phase_index": 99}}),
        "words for steps": ClipState(arrays, header | {"resume": resume | {"steps_in_phase": "many"}}),
        "no order": ClipState(arrays, header | {"resume": resume | {"order": {}}}),
        "no random numbers": ClipState(arrays, header | {"resume": resume | {"generator": [1, 2]}}),
        "no gains": ClipState({name: array for name, array in arrays.items() if name != "resume.gains"}, header),
        "gains of others": ClipState(arrays | {"resume.gains": gains[:2]}, header),
        "gains NaN": ClipState(arrays | {"resume.gains": gains * np.float32("nan")}, header),
        "turned pictures": ClipState(arrays | {"resume.backgrounds": images.swapaxes(1, 2)}, header),
        "short moments": ClipState(arrays | {moment: arrays[moment].reshape(-1)[:1]}, header),
        "no anchors": ClipState({name: a for name, a in arrays.items() if "residual.positions" not in name}, header),
        "no spacing": ClipState(arrays, {name: value for name, value in header.items() if name != "spacing"}),
    }
