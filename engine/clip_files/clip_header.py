"""The header of a clip file, declared once and looked at once, when it is read.

A header of another kind is a damaged file; nothing behind this module looks at the type of an entry again.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from msgspec import Meta, Struct, to_builtins

from engine.storage.json_files import json_text, parse_object
from engine.storage.typed_json import EntryError, to_type
from engine.text import shown

SCHEMA = 2
STORED_SCHEMA = 3
"""Of clips that hold Gaussians instead of anchors, which earlier versions cannot show."""
READABLE = (1, SCHEMA, STORED_SCHEMA)
"""Schema 1 knew no compact form; its files are read like any other that holds its arrays as they are."""
_MAX_TABLE_VALUES = 2**28
"""All values of a field's tables are fewer: its memory is taken before the arrays are compared with it."""

Count = Annotated[int, Meta(ge=0, lt=2**31)]
"""Frames, steps, clips and anchors."""
Size = Annotated[int, Meta(gt=0, le=2**24)]
"""Cells, table entries and widths of layers."""
Length = Annotated[float, Meta(gt=0, lt=1e30)]
"""Scene units."""
SettingValue = bool | int | float | str
"""Of one training setting."""
Figure = float | None
"""None where it was not measured."""


class DecoderShape(Struct, frozen=True):
    """Sizes of a decoder; what its constructor takes.

    Attributes:
        static_dim, dynamic_dim: Widths of the two features.
        gaussians_per_anchor: K.
        hidden: Width of the heads' hidden layers.
    """

    static_dim: Size
    dynamic_dim: Size
    gaussians_per_anchor: Size
    hidden: Size


class FieldShape(Struct, frozen=True):
    """Sizes of a field, saved next to it.

    Attributes:
        n_knots: Frames of the clip.
        cells: Cells along the longest side per level.
        n_entries: Table entries per level, a power of two.
        channels: Values per entry.
        hidden: Width of the network's hidden layer.
        feature_dim: Width of the dynamic feature.
        bounds_min: Lower corner of the box, scene units. [3]
        side: Length of the box's longest side, scene units.
        is_shared: Whether all knots share one table, as in the published 4D hash, instead of one each.
        aspect: Sides of the box as shares of the longest; every axis has the same number of cells. A cube unless said.
        is_rectified: Whether the network ends in a ReLU, so that no dynamic feature is negative.
        strides: Knots in a row that read the same entries, per level; one unless said.
    """

    n_knots: Size
    cells: tuple[Size, ...]
    n_entries: Size
    channels: Size
    hidden: Size
    feature_dim: Size
    bounds_min: tuple[float, float, float]
    side: Length
    is_shared: bool = False
    aspect: tuple[Length, Length, Length] = (1.0, 1.0, 1.0)
    is_rectified: bool = False
    strides: tuple[Size, ...] = ()

    def __post_init__(self) -> None:
        if max(self.n_tables * self.n_entries * self.channels, self.n_knots) * len(self.cells) > _MAX_TABLE_VALUES:
            raise ValueError(f"more than {_MAX_TABLE_VALUES} values in its tables")
        if not all(map(math.isfinite, self.bounds_min)):
            raise ValueError(f"bounds_min {shown(self.bounds_min)}")
        if self.strides and (len(self.strides) != len(self.cells) or not self.is_shared):
            raise ValueError(f"strides {shown(self.strides)}")

    @property
    def n_tables(self) -> int:
        """Tables of the field."""
        return 1 if self.is_shared else self.n_knots


class Coverage(Struct, frozen=True):
    """How much of what moves in a source clip has an anchor near it.

    Attributes:
        n_points: Moving points of the clip.
        n_inherited: Of these, inside the spheres of inherited anchors.
        n_residual: Anchors of the clip's own.
        n_left_out: Points that would have become anchors beyond the budget.
        share: Of the points that are within reach of an anchor of either kind; 1 where nothing moves.
        reason: Where the budget comes from.
    """

    n_points: Count
    n_inherited: Count
    n_residual: Count
    n_left_out: Count
    share: float
    reason: str

    @property
    def text(self) -> str:
        """The text shown while the clip is prepared."""
        n_outside = self.n_points - self.n_inherited
        percent = 100 * n_outside / max(self.n_points, 1)
        said = f"{n_outside:,} of {self.n_points:,} moving points ({percent:.0f} %) lie outside the inherited anchors; "
        said += f"{self.n_residual:,} residual anchors ({self.reason})"
        if self.n_left_out:
            said += f", {self.n_left_out:,} points left to neighbouring anchors"
        return f"{said}; {100 * self.share:.1f} % of what moves is within reach of an anchor"


class ClipFigures(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The figures of a finished clip and its training.

    Attributes:
        held_out_psnr: Of held-out pictures, dB.
        held_out_whole: Whether that is over all its frames in all held-out cameras; else over at most three pictures.
        gradient_norm_median, gradient_norm_max: Over all steps.
        gradient_clipped_steps: Steps whose gradient was scaled down.
        stages_s: Wall seconds per stage, in the order they were entered.
        preparation_s, training_s: Together all of them.
        memory_mb: Most memory of the training, 10^6 bytes.
    """

    held_out_psnr: Figure = None
    held_out_whole: bool = False
    gradient_norm_median: Figure = None
    gradient_norm_max: Figure = None
    gradient_clipped_steps: Count | None = None
    stages_s: dict[str, float] = {}
    preparation_s: Figure = None
    training_s: Figure = None
    memory_mb: Figure = None

    @property
    def seconds(self) -> float | None:
        """All of the training; None where not recorded."""
        if self.preparation_s is None or self.training_s is None:
            return None
        return self.preparation_s + self.training_s


class Place(Struct, frozen=True, kw_only=True):
    """Where a training stands.

    Attributes:
        phase_index: Phase that was begun last.
        steps_in_phase: Steps done in it.
        phases: Name and number of steps of every phase; none of a phase that had nothing to learn.
        order: State of the order in which pictures are drawn.
        generator: State of the training's random numbers.
    """

    phase_index: Count
    steps_in_phase: Count
    phases: list[tuple[str, Count]]
    order: dict[str, Any]
    generator: list[Count]

    def __post_init__(self) -> None:
        if self.phase_index >= len(self.phases):
            raise ValueError(f"phase_index is {self.phase_index}, of {len(self.phases)} phases")


class ClipHeader(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The header of a clip file. Entries with a default came later than the others, or not every clip has them.

    Attributes:
        role: Whether other clips can inherit from this one, or it inherits itself.
        holds: Anchors that were trained, or Gaussians of another program, see engine.clip_files.stored_gaussians.
        clip_length: M, the divisor of clip_time.
        n_frames, start: Frames of this clip, and where in the capture they begin.
        step, n_steps: Steps done, and those of the whole training.
        config: Settings that differ from their defaults.
        camera_names: Of the gains.
        near_plane, spacing: Scene units; spacing is that of the static anchors.
        moving_spacing: Voxels of the hulls, scene units; None or 0 where nothing moves.
        n_anchors: Rows of each anchor set, inherited ones too, by role.
        n_alive: Most moving anchors in one frame.
        fingerprint: Of the arrays: names what a source clip was trained against.
        rows_of: Fingerprint of the clip that this one was before it was mended, where it has the same anchors in the
            same rows still; see `origin`.
        exclusions: The parts of its pictures excluded from its training, see engine.capture.exclusions.exclusion_key.
        reference_fingerprint: Of the clip that this one inherits from.
        previous_fingerprint: Of the clip that this one continues from.
        metrics: Of a finished clip; see `figures`.
        resume: Of a checkpoint: where the training stands.
    """

    schema: int
    role: Literal["reference", "source"]
    clip_index: Count
    clip_length: Size
    n_frames: Count
    start: Count
    step: Count
    n_steps: Count
    seed: int
    config: dict[str, SettingValue]
    camera_names: list[str]
    near_plane: Length
    spacing: Length
    decoder: DecoderShape
    field: FieldShape | None
    fingerprint: str
    holds: Literal["anchors", "gaussians"] = "anchors"
    moving_spacing: Annotated[float, Meta(ge=0, lt=1e30)] | None = None
    n_anchors: dict[str, Count] = {}
    n_alive: Count | None = None
    coverage: Coverage | None = None
    rows_of: str = ""
    exclusions: str = ""
    reference_fingerprint: str | None = None
    previous_fingerprint: str | None = None
    metrics: ClipFigures | None = None
    resume: Place | None = None

    def __post_init__(self) -> None:
        if self.role == "source" and self.reference_fingerprint is None:
            raise ValueError("it has no reference_fingerprint")

    @property
    def figures(self) -> ClipFigures:
        """The figures of a finished clip; all of them missing elsewhere."""
        return self.metrics or ClipFigures()

    @property
    def origin(self) -> str:
        """Fingerprint by which edits name the clip's own anchors: what was picked holds for a mended clip, too."""
        return self.rows_of or self.fingerprint


class NewerSchema(ValueError):
    """A file of a newer version."""


def parse_header(text: str) -> ClipHeader:
    """The header of a clip file.

    Raises:
        JsonError, EntryError: It is damaged, or not a clip's; names the entry.
        NewerSchema: This version cannot read it.
    """
    values = parse_object(text, is_nan_allowed=True)
    schema = values.get("schema")
    if type(schema) is int and schema > READABLE[-1]:
        raise NewerSchema(f"it has schema {schema}, this version reads 1 to {READABLE[-1]}")
    if type(schema) is not int or schema not in READABLE:
        raise EntryError(f"its header has schema {shown(schema)}")
    _bring_up_to_date(values)
    try:
        return to_type(values, ClipHeader)
    except EntryError as error:
        raise EntryError(f"in its header {error}") from error


def header_text(header: ClipHeader) -> str:
    """Inverse of `parse_header`."""
    return json_text(to_builtins(header, builtin_types=()))


def _bring_up_to_date(values: dict[str, Any]) -> None:
    """Convert the entries that earlier versions wrote in another way."""
    if isinstance(values.get("resume"), str):
        values["resume"] = parse_object(values["resume"])
    figures = values.get("metrics")
    if isinstance(figures, dict):  # NaN stood for what was not measured
        values["metrics"] = {name: value for name, value in figures.items() if not _is_nan(value)}


def _is_nan(value: Any) -> bool:
    return isinstance(value, float) and not math.isfinite(value)
