"""Options of all exports of Gaussians: how the scene lies in a file."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from app.export.jobs.job import option
from app.export.jobs.question import Question
from engine.export.sequences.table import SEQUENCES, SequenceFormat
from engine.export.world import AXES
from engine.setting import Flag, Writing, value_text

Vector = tuple[float, float, float]


def _read_vector(text: str) -> Vector:
    x, y, z = map(float, text.split())
    return x, y, z


def _vector_text(vector: Vector) -> str:
    return " ".join(map(value_text, vector))


def _usual_up() -> str:
    """Which axis points up in each format where the user chooses none."""
    turned: dict[str, list[str]] = {}
    for name, row in SEQUENCES.items():
        if row.up is not None:
            turned.setdefault(row.up, []).append(name)
    return "; ".join(["as in the capture", *(f"{up} in {', '.join(names)}" for up, names in turned.items())])


def _up(usual: str) -> Any:
    return option(
        "Turns the scene so that up points along this axis of the files",
        "Up axis",
        none=usual,
        choices=dict.fromkeys(AXES, ""),
        titles={"": "As in the capture", "+y": "+y", "-y": "-y", "+z": "+z", "-z": "-z"},
        flags=(
            Flag("--up", "Turns the scene so that this axis points up", prefix="+"),
            Flag("--down", "Turns the scene so that this axis points down", prefix="-"),
        ),
    )


def asked_up(question: Question, kind: SequenceFormat) -> Question:
    """The question about the axis, whose usual answer is that of a format."""
    if kind.up is None:
        return question
    return replace(question, values=(("", f"As {kind.title} has it: {kind.up}"), *question.values[1:]))


UP, USD_UP = _up(_usual_up()), _up(f"{SEQUENCES['usd'].up}, as USD files of Gaussians")
SCALE = option(
    "Units of the files per unit of the capture",
    "Scale",
    low=1e-6,
    high=1e6,
    none="metres where the project says how long a unit is, else as in the capture",
    titles={"": "Metres, where the scale is known"}
    | {size: size for size in ("1", "0.001", "0.01", "10", "100", "1000")},
    like="S",
)
SCENE_UP = option(
    "Which way is up in the capture, for the up axis of the files",
    "Up in the capture",
    none="set in the project, else derived from the cameras",
    titles={"": "As in the project"} | {_vector_text(axis): name for name, axis in AXES.items()},
    writing=Writing("X Y Z", "three numbers", _read_vector, _vector_text),
)
