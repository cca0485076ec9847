"""The fingerprint of the sample: what a very short training of it with the default settings gives, as a few numbers.

An entry of the ledger keeps that of the code it was measured with, and the default settings. A test compares both:
where they differ, the engine trains otherwise than it did, and the headline figures are those of another program.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from app.cli.cli import main as clipgstream
from engine.clip_files.clip_state import read_clip_state
from engine.training.config import TrainConfig

SAMPLE = Path(__file__).resolve().parents[2] / "assets" / "sample"
SETTINGS = ("static_steps=40", "joint_steps=40", "source_steps=40", "storage=exact")
N_CLIPS = 2
MIN_SIZE = 900
"""Values of an array that counts: means of fewer hang on single steps of the optimizer."""
LEFT_OUT = ("field.tables", "field.hidden", "inherited.static.light")
"""How names of other arrays begin: sizes of the field are powers of two, which one anchor may double, and light is next
to nothing in the sample."""
COUNT_TOLERANCE, MEAN_TOLERANCE = 0.05, 0.08
"""Relative. Stereo decides by comparisons, which rounding turns: compiled for a processor with other instructions, the
same code gave 2.4 % fewer moving anchors, and means that differed by up to 5.3 %. Threads change no bit."""


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
            if array.size >= MIN_SIZE and not name.startswith(LEFT_OUT):
                found[f"{clip_index}.{name}"] = array.size, float(f"{np.abs(array, dtype=np.float64).mean():.6g}")
    return found


def default_settings() -> dict[str, Any]:
    """Every setting of a training with its default."""
    return msgspec.to_builtins(TrainConfig())


def changed_settings(then: dict[str, Any]) -> list[str]:
    """Settings that have another default than then, in words. Settings that came or went since then do not count."""
    now = default_settings()
    return [f"{name} is {now[name]}, not {then[name]}" for name in sorted(then.keys() & now) if then[name] != now[name]]


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
