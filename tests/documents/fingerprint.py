"""The fingerprint of the sample: what a very short training of it with the default settings gives, as a few numbers.

An entry of the ledger keeps that of the code it was measured with. A test takes it again: where it differs, the engine
trains otherwise than it did, and the headline figures are those of another program.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from app.cli.cli import main as clipgstream
from engine.clip_files.clip_state import read_clip_state

SAMPLE = Path(__file__).resolve().parents[2] / "assets" / "sample"
SETTINGS = ("static_steps=40", "joint_steps=40", "source_steps=40", "storage=exact")
N_CLIPS = 2
COUNT_TOLERANCE = 0.01
"""Relative. Stereo decides by comparisons, which rounding may turn: processors differ there by a few points."""
MEAN_TOLERANCE = 0.01
"""Relative, of the mean magnitude of an array. The number of threads changes no bit; what moves it by a
thousandth changes figures by less than a seed does."""


def fingerprint(folder: Path) -> dict[str, tuple[int, float]]:
    """Train the sample very briefly in a folder that does not exist yet; size and mean magnitude of every array.

    Raises RuntimeError where training fails.
    """
    settings = [part for setting in SETTINGS for part in ("--set", setting)]
    options = ["--project", str(folder), "--clips", f"0:{N_CLIPS}", "--scale", "0.5", "--quiet"]
    if code := clipgstream(["train", str(SAMPLE), *options, *settings]):
        raise RuntimeError(f"training the sample ended with code {code}")
    found = {}
    for clip_index in range(N_CLIPS):
        for name, array in sorted(read_clip_state(folder / "clips" / f"{clip_index:04d}.safetensors").arrays.items()):
            if array.size:
                found[f"{clip_index}.{name}"] = array.size, float(f"{np.abs(array, dtype=np.float64).mean():.6g}")
    return found


def differences(then: dict[str, tuple[int, float]], now: dict[str, tuple[int, float]]) -> list[str]:
    """What two fingerprints do not agree in, in words; empty where they are of the same engine."""
    found = [f"{name} is in one only" for name in sorted(then.keys() ^ now.keys())]
    for name in sorted(then.keys() & now.keys()):
        (size, mean), (new_size, new_mean) = then[name], now[name]
        if abs(new_size - size) > COUNT_TOLERANCE * size:
            found.append(f"{name} has {new_size} values, not {size}")
        if abs(new_mean - mean) > MEAN_TOLERANCE * abs(mean):
            found.append(f"{name} is {new_mean:.4g} in the mean, not {mean:.4g}")
    return found
