"""Actions: what edits do. Each is declared here, once: what it is called, its values with their ranges and words.

The options of `clipgstream edit`, the commands to copy, the names that scripts use, the fields of the Edits panel and
the tables of the documents follow from these declarations. What an action makes of Gaussians is in EditedClip, for what
moves, and in StillPart.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Any, ClassVar, Self, get_args

from msgspec import Meta, Struct, structs

from engine.setting import Flag, Setting, setting, settings_of

__all__ = ["Delete", "Expose", "Hide", "Hold", "Recolor", "Smooth", "Transform"]  # for scripts to import

Vector = tuple[float, float, float]
Quat = tuple[float, float, float, float]
"""wxyz"""
ORIGIN, ONES = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
FAR = 1e12
"""Largest coordinate, scene units."""


def value(meaning: str, label: str, written: str, *flags: Flag, **said: Any) -> Meta:
    """The annotation of a value of an action.

    Args:
        meaning: Its meaning, for help and as a tip.
        label: Of its field.
        written: As help shows it: "--move X Y Z".
        flags: Other ways to write it.
        said: More of what `engine.setting.setting` takes.
    """
    flag, like = written.split(maxsplit=1)
    return setting("", meaning, label=label, like=like, flags=(Flag(flag), *flags), **said)


class EditAction(Struct, frozen=True, forbid_unknown_fields=True):
    """The base of what edits do. Its tag names it in documents and scripts.

    Attributes:
        label: On buttons.
        tip: Its effect on the selection, for menus, where the label is not enough.
        meaning: Its effect on an edit's target, in a sentence.
        verb: As it can follow "Undo", where that is not the label.
        adverb: The same, after what is acted on; the name of a value in braces stands for the value.
        opposite: Name of doing it to everything else, if there is one.
        centered: The value that is the middle of what is acted on, where it is not given.

    Raises:
        ValueError: A value is out of range.
    """

    label: ClassVar[str]
    tip: ClassVar[str] = ""
    meaning: ClassVar[str]
    verb: ClassVar[str] = ""
    adverb: ClassVar[str] = ""
    opposite: ClassVar[str] = ""
    centered: ClassVar[str] = ""

    def __post_init__(self) -> None:
        for one in settings_of(type(self)).values():
            if not one.is_within(found := getattr(self, one.name)):
                raise ValueError(f"{one.name} is {found}; it has to be {one.allowed}")

    @classmethod
    def flags(cls) -> dict[str, tuple[Flag, list[Setting]]]:
        """How the command line writes it: by option, the flag, and whose values follow; without values its name."""
        found: dict[str, tuple[Flag, list[Setting]]] = {}
        for one in settings_of(cls).values():
            for flag in one.flags:
                found.setdefault(flag.name, (flag, []))[1].append(one)
        name = f"--{cls.called()}"
        return found or {name: (Flag(name, cls.meaning), [])}

    @classmethod
    def called(cls) -> str:
        """Its name in documents and scripts."""
        return str(cls.__struct_config__.tag)

    @property
    def words(self) -> tuple[str, str]:
        """The action in words, before and after its object; the latter may be empty."""
        return self.verb or self.label.lower(), self.adverb.format(**structs.asdict(self))

    def changed(self, name: str, found: Any) -> Self:
        """With another value, as somebody chooses it while looking at the picture."""
        return structs.replace(self, **{name: found})


class Hide(EditAction, frozen=True, tag="hide"):
    """The Gaussians are drawn nowhere, but stay in the clips when edits are applied permanently."""

    label = "Hide"
    meaning = "Does not draw it"
    opposite = "isolate"


class Delete(EditAction, frozen=True, tag="delete"):
    """The Gaussians are gone; from the clips too, once edits are applied permanently."""

    label = "Delete"
    meaning = "Removes it"


def _turn(numbers: tuple[float, ...]) -> Quat:
    """An axis and degrees as a rotation. Raises ValueError."""
    *axis, degrees = numbers
    length = math.hypot(*axis)
    if not (math.isfinite(length) and math.isfinite(degrees) and length > 0.0):
        raise ValueError("the axis or angle is missing; write for example 0 1 0 90")
    half = math.radians(degrees) / 2
    x, y, z = (math.sin(half) * part / length for part in axis)
    return math.cos(half), x, y, z


class Transform(EditAction, frozen=True, tag="transform"):
    """The Gaussians are scaled and turned about a pivot, then moved: x -> pivot + scale R (x - pivot) + translation.

    Raises:
        ValueError: A number is not finite, the scale not positive, or the quaternion is not a rotation.
    """

    label = "Move"
    tip = "Move, rotate and scale the selection"
    meaning = "Scales and rotates about a pivot, then moves"
    centered = "pivot"

    translation: Annotated[
        Vector, value("Distance in scene units", "Move by", "--move X Y Z", low=-FAR, high=FAR, step=2e-3)
    ] = ORIGIN
    quat: Annotated[
        Quat,
        value(
            "A rotation, as a quaternion",
            "Rotate by",
            "--quat W X Y Z",
            Flag("--rotate", "Rotation about this axis, in degrees", like="X Y Z DEG", read=_turn),
        ),
    ] = (1.0, 0.0, 0.0, 0.0)
    scale: Annotated[
        float, value("Factor of the size", "Scale by", "--scale S", low=0, high=FAR, offered=(0.01, 100))
    ] = 1.0
    pivot: Annotated[
        Vector, value("Pivot of rotation and scale", "About", "--pivot X Y Z", low=-FAR, high=FAR, step=2e-3)
    ] = ORIGIN

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.scale:
            raise ValueError("a scale of 0 makes everything vanish")
        check_quat(self.quat)

    @property
    def words(self) -> tuple[str, str]:
        """Which of moving, rotating and scaling are done."""
        is_done = {"move": any(self.translation), "rotate": abs(self.quat[0]) < 1.0, "scale": self.scale != 1.0}
        *others, last = [word for word in is_done if is_done[word]] or ["move"]
        return f"{', '.join(others)} and {last}" if others else last, ""


class Recolor(EditAction, frozen=True, tag="recolor"):
    """Their colours, display-encoded, become: mixed with a tint, more or less saturated, times gains; their opacities
    are multiplied. The result is held in 0..1."""

    label = "Recolour"
    meaning = "Mixes in a tint, then changes saturation, gains and opacity"

    tint: Annotated[
        Vector,
        value("Mix this colour in: red, green, blue and its share, 0 to 1", "Tint", "--recolour R G B", low=0, high=1),
    ] = (0.5, 0.5, 0.5)
    tint_share: Annotated[
        float, value("How much of the tint is mixed in", "Tint share", "--recolour SHARE", low=0, high=1)
    ] = 0.0
    saturation: Annotated[
        float,
        value("0 is grey, 1 leaves colours alone", "Saturation", "--saturation S", low=0, high=100, offered=(0, 4)),
    ] = 1.0
    gains: Annotated[
        Vector, value("Factors of the three channels", "Gains", "--gains R G B", low=0, high=100, offered=(0, 10))
    ] = ONES
    opacity: Annotated[
        float, value("Factor of the opacity", "Opacity", "--opacity S", low=0, high=100, offered=(0, 4))
    ] = 1.0

    @property
    def words(self) -> tuple[str, str]:
        """Opacity has a word of its own."""
        is_opacity = self == Recolor(opacity=self.opacity) and self.opacity != 1.0
        return ("change opacity of", "") if is_opacity else super().words

    def changed(self, name: str, found: Any) -> Self:
        """A tint that is chosen is mixed in: otherwise nothing would be seen of it."""
        other = super().changed(name, found)
        return structs.replace(other, tint_share=0.5) if name == "tint" and not self.tint_share else other


class Expose(EditAction, frozen=True, tag="expose"):
    """The Gaussians' light is multiplied by 2 to the power of `stops`, in linear light."""

    label = "Exposure"
    tip = "Change the exposure of the selection"
    meaning = "Multiplies the light"
    verb = "expose"
    adverb = "by {stops:+.3g} EV"

    stops: Annotated[
        float,
        value(
            "Brighter or darker, 1 doubles the light",
            "Exposure",
            "--exposure STOPS",
            low=-16,
            high=16,
            unit="EV",
            step=0.01,
        ),
    ]


class Hold(EditAction, frozen=True, tag="hold"):
    """The Gaussians stand still as at one frame; in clips without that frame, as at their frame next to it."""

    label = "Set static"
    tip = "Set static: freeze the selection as in this frame"
    meaning = "Freezes it as in one frame"
    verb = "hold"
    adverb = "as in frame {frame_index}"

    frame_index: Annotated[
        int,
        value(
            "Freezes it as in this frame",
            "As in frame",
            "--hold FRAME",
            low=0,
            high=2**31 - 1,
            names="frames",
        ),
    ]


class Smooth(EditAction, frozen=True, tag="smooth"):
    """The Gaussians change more slowly: each is a weighted mean of itself over frames of its clip around the moment."""

    label = "Smooth"
    tip = "Smooth the selection over time"
    meaning = "Smooths changes over time: a mean over neighbouring frames of the clip"
    adverb = "over {sigma_frames:.3g} frames"

    sigma_frames: Annotated[
        float,
        value(
            "Smooths changes over time: standard deviation of the mean",
            "Over",
            "--smooth FRAMES",
            low=0.1,
            high=100,
            unit="frames",
            step=0.02,
        ),
    ]


Action = Hide | Delete | Transform | Recolor | Expose | Hold | Smooth
ACTIONS: dict[str, type[Action]] = {kind.called(): kind for kind in get_args(Action)}
"""All of them, by the name that documents and scripts use."""


def check_quat(quat: Quat) -> None:
    """Check that it is a rotation. Raises ValueError."""
    length = math.sqrt(sum(number * number for number in quat))
    if not abs(length - 1.0) <= 1e-3:
        raise ValueError(f"the quaternion {quat} is not a rotation: its length is {length:g}")


def vector_of(values: Iterable[float]) -> Vector:
    """Three numbers, of an array for instance, as a value of documents. [3]"""
    x, y, z = (float(value) for value in values)
    return x, y, z
