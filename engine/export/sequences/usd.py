"""USD over time: still Gaussians as prims that are shown for some time, moving ones as a prim with samples of time.

Both are of the schema ParticleField3DGaussianSplat, which OpenUSD has since 26.03. The library (usd-core) is imported
here when it is needed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from engine.conventions import ALPHA_MIN
from engine.errors import ProjectError
from engine.export.player.blocks import joined
from engine.export.sequences.sequence import SequenceStretch, SequenceTiming
from engine.export.sequences.still_rows import LastingRows, StillRows
from engine.export.splats import Splats, colors_of
from engine.export.usd_library import state_unit, usd_module, writing_usd
from engine.export.world import AXES, FileWorld

ROOT = "/Scene"
MAX_FRAMES = 1_000_000
MAX_GAUSSIANS = 1 << 22
"""Of a moment."""


def check() -> None:
    """Raises ProjectError where the library is missing."""
    _library()


def _library() -> Any:
    """The modules of the library by their names. Raises ProjectError where it is missing."""
    return SimpleNamespace(**{name: usd_module(name) for name in ("Tf", "Usd", "UsdGeom", "UsdVol", "Vt")})


# -------------------------------------------------------------------- writing


def write(stretches: Iterable[SequenceStretch], timing: SequenceTiming, path: Path) -> tuple[str, ...]:
    """Write a file, as text where its suffix is .usda; memory holds a few frames, but of text all of them.

    Returns:
        Sentences about what could not be stored as it is.
    Raises:
        ProjectError: The library is missing.
        OSError: The disk refused.
    """
    path.unlink(missing_ok=True)
    file = _UsdFile(path, timing)
    still, end = StillRows(), 0
    for stretch in stretches:
        file.still(still.add(_drawn(stretch.still), stretch.first_frame))
        end = stretch.first_frame + stretch.n_frames
        for frame in range(stretch.first_frame, end):
            file.moving(frame, _drawn(stretch.moving(frame).splats))
        file.save()
    file.still(still.close(end))
    file.save()
    return file.notes()


def _drawn(splats: Splats) -> Splats:
    return splats[np.flatnonzero(splats.opacities > ALPHA_MIN)]


class _UsdFile:
    """A file that is being written."""

    def __init__(self, path: Path, timing: SequenceTiming) -> None:
        self._pxr = _library()
        usd, geom = self._pxr.Usd, self._pxr.UsdGeom
        with writing_usd():
            self._stage = usd.Stage.CreateNew(str(path))
        self._n_frames, self._n_still = timing.n_frames, 0
        self._up: tuple[float, float, float] | None = None
        self._stage.SetDefaultPrim(geom.Xform.Define(self._stage, ROOT).GetPrim())
        state_unit(self._stage, timing.meters_per_unit)
        self._stage.SetTimeCodesPerSecond(timing.fps)
        self._stage.SetFramesPerSecond(timing.fps)
        self._stage.SetStartTimeCode(0.0)
        self._stage.SetEndTimeCode(float(timing.n_frames - 1))
        self._moving = self._field(f"{ROOT}/Moving")

    def _field(self, name: str) -> Any:
        field = self._pxr.UsdVol.ParticleField3DGaussianSplat.Define(self._stage, name)
        field.CreateRadianceSphericalHarmonicsDegreeAttr(0)
        return field

    def moving(self, frame: int, splats: Splats) -> None:
        """What moves at a frame."""
        self._set(self._moving, splats, float(frame))

    def still(self, rows: LastingRows | None) -> None:
        """Rows that stand still, in a prim for each time at which some of them begin."""
        if rows is None:
            return
        for first in np.unique(rows.first).tolist():
            field = self._field(f"{ROOT}/Still_{self._n_still:04d}")
            self._n_still += 1
            self._set(field, rows.splats[np.flatnonzero(rows.first == first)], None)
            shown = field.CreateVisibilityAttr()
            tokens = self._pxr.UsdGeom.Tokens
            for frame, is_shown in ((0, first == 0), (first, True), (rows.end, False)):
                if frame < self._n_frames:
                    shown.Set(tokens.inherited if is_shown else tokens.invisible, float(frame))

    def _set(self, field: Any, splats: Splats, time: float | None) -> None:
        if self._up is None:
            self._up = splats.up
            geom = self._pxr.UsdGeom
            geom.SetStageUpAxis(self._stage, geom.Tokens.z if splats.up[2] > 0.5 else geom.Tokens.y)
        vt = self._pxr.Vt
        reach = splats.scales.max(1, initial=0.0)[:, None] * 3.0
        box = np.zeros((2, 3), np.float32)
        if len(splats):
            box = np.stack([(splats.means - reach).min(0), (splats.means + reach).max(0)])
        values = (
            (field.CreatePositionsAttr(), vt.Vec3fArray.FromNumpy(splats.means)),
            (field.CreateOrientationsAttr(), vt.QuatfArray.FromNumpy(splats.quats[:, [1, 2, 3, 0]].copy())),
            (field.CreateScalesAttr(), vt.Vec3fArray.FromNumpy(splats.scales)),
            (field.CreateOpacitiesAttr(), vt.FloatArray.FromNumpy(splats.opacities)),
            (field.CreateRadianceSphericalHarmonicsCoefficientsAttr(), vt.Vec3fArray.FromNumpy(splats.f_dc)),
            (field.CreateExtentAttr(), vt.Vec3fArray.FromNumpy(box.astype(np.float32))),
        )
        for attribute, value in values:
            if time is None:
                attribute.Set(value)
            else:
                attribute.Set(value, time)

    def save(self) -> None:
        """Put down what there is, so that memory stays free. Raises OSError."""
        with writing_usd():
            self._stage.Save()

    def notes(self) -> tuple[str, ...]:
        """See `write`."""
        up = np.array(self._up or (0.0, 1.0, 0.0))
        if up[1:].max() > 1.0 - 1e-6:
            return ()
        return ("USD knows y and z as the way up; the file says y, which is not how the scene lies.",)


# -------------------------------------------------------------------- reading


class UsdReader:
    """A USD file, opened: the Gaussians of all of its fields. Not for several threads at once.

    Args:
        path: The file.
    Raises:
        ProjectError: The library is missing, the file is damaged or has no Gaussians, or asks for more than a limit.
    """

    def __init__(self, path: Path) -> None:
        self._pxr, self._path = _library(), path
        try:
            self._stage = self._pxr.Usd.Stage.Open(str(path))
        except self._pxr.Tf.ErrorException as error:
            raise _damaged("it is not a USD file, or ends too early", path) from error
        schema = self._pxr.UsdVol.ParticleField3DGaussianSplat
        self._fields = [schema(prim) for prim in self._stage.Traverse() if prim.IsA(schema)]
        if not self._fields:
            raise _damaged("it has no prim of the type ParticleField3DGaussianSplat", path)
        stage = self._stage
        self._first, fps = stage.GetStartTimeCode(), stage.GetTimeCodesPerSecond()
        n_frames = stage.GetEndTimeCode() - self._first + 1.0
        if not (fps > 0.0 and 1.0 <= n_frames <= MAX_FRAMES):
            raise _damaged(f"it has {n_frames:g} frames at {fps:g} per second", path)
        self._timing = SequenceTiming(int(n_frames), float(fps))
        is_z_up = self._pxr.UsdGeom.GetStageUpAxis(stage) == self._pxr.UsdGeom.Tokens.z
        self._up = AXES["+z" if is_z_up else "+y"]

    @property
    def timing(self) -> SequenceTiming:
        """When its frames are shown."""
        return self._timing

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the file is not kept, as sentences for the user."""
        degrees = [field.GetRadianceSphericalHarmonicsDegreeAttr().Get() or 0 for field in self._fields]
        return ("Colours that depend on the direction of view are left out.",) if max(degrees) else ()

    def close(self) -> None:
        """Let go of the file."""
        self._fields, self._stage = [], None

    def splats(self, frame: int) -> Splats:
        """All Gaussians of a frame of the file. Raises ProjectError where it is damaged there."""
        if not 0 <= frame < self._timing.n_frames:
            raise ValueError(f"the file has frames 0 to {self._timing.n_frames - 1}, not {frame}")
        time = self._pxr.Usd.TimeCode(self._first + frame)
        invisible = self._pxr.UsdGeom.Tokens.invisible
        parts = [_NONE]
        with self._typed_errors(frame):
            for field in self._fields:
                if field.ComputeVisibility(time) != invisible:
                    found = self._columns(field, time)
                    parts.append(_moved(found, np.array(field.ComputeLocalToWorldTransform(time)), self._path))
        n = sum(map(len, parts))
        if n > MAX_GAUSSIANS:
            raise _damaged(f"it has {n:,} Gaussians in frame {frame}; {MAX_GAUSSIANS:,} are read", self._path)
        return replace(joined(*parts), up=self._up)

    @contextmanager
    def _typed_errors(self, frame: int) -> Iterator[None]:
        """Values that cannot be read, or are of another type than the schema's, are an error of the file."""
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                yield
        except (self._pxr.Tf.ErrorException, ValueError, TypeError, MemoryError) as error:
            raise _damaged(f"values of frame {frame} are damaged, or of another type", self._path) from error

    def _columns(self, field: Any, time: Any) -> Splats:
        attributes = (
            (field.GetPositionsAttr(), field.GetPositionshAttr(), 3),
            (field.GetOrientationsAttr(), field.GetOrientationshAttr(), 4),
            (field.GetScalesAttr(), field.GetScaleshAttr(), 3),
            (field.GetOpacitiesAttr(), field.GetOpacitieshAttr(), 1),
            (
                field.GetRadianceSphericalHarmonicsCoefficientsAttr(),
                field.GetRadianceSphericalHarmonicsCoefficientshAttr(),
                3,
            ),
        )
        found = []
        for usual, half, width in attributes:
            value = usual.Get(time)
            value = value or half.Get(time)
            found.append(np.zeros((0, width)) if not value else np.array(value, np.float32).reshape(-1, width))
        means, quats, scales, opacities, colors = found
        n_each = (1 + (field.GetRadianceSphericalHarmonicsDegreeAttr().Get() or 0)) ** 2
        colors = colors[::n_each]  # of each Gaussian the coefficient of degree 0 comes first
        lengths = [len(column) for column in (means, quats, scales, opacities, colors)]
        if len(set(lengths)) > 1:
            raise _damaged(f"its columns have {', '.join(map(str, lengths))} rows", self._path)
        return Splats.from_arrays(means, quats[:, [3, 0, 1, 2]], scales, opacities[:, 0], colors_of(colors))


def _moved(splats: Splats, matrix: np.ndarray, path: Path) -> Splats:
    """Gaussians of a prim where the stage has it. matrix: For rows in front of it. [4, 4]"""
    turn = matrix[:3, :3].T
    scale = float(np.cbrt(np.linalg.det(turn)))
    if not (scale > 0.0 and np.allclose(turn @ turn.T, scale**2 * np.eye(3), atol=1e-4 * scale**2)):
        raise _damaged("a prim is sheared, mirrored or stretched", path)
    if np.allclose(matrix, np.eye(4)):
        return splats
    moved = FileWorld(turn / scale, scale).placed(splats)
    means = (moved.means + matrix[3, :3]).astype(np.float32)
    return Splats(means, moved.quats, moved.scales, moved.opacities, moved.colors)


def _damaged(reason: str, path: Path) -> ProjectError:
    return ProjectError(f"This USD file cannot be read: {reason}.", hint="Export it again.", path=path)


_NONE = Splats.from_arrays(np.zeros((0, 3)), np.zeros((0, 4)), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)))
