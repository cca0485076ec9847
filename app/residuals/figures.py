"""Figures of every picture of a project, as arrays over frames and cameras, and the score of each seam.

Numbers are those of the rows of an evaluation. A reading of kept figures or a measuring hands them over clip by clip;
those of a clip trained again are forgotten.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from app.residuals.heat_map import LEVELS
from app.status import CELL_COLUMNS, SeamStatus
from engine.capture.clip import Clip
from engine.metrics.clips.seams import PairRow, ratio_of, score_of
from engine.metrics.clips.summary import EvalRow, mean_of

N_SEAMS_PER_CALL = 20
"""Scores that are made at a time: about half a millisecond each with thirty cameras."""


@dataclass(frozen=True, slots=True)
class RowFigures:
    """Figures of one picture. None where a figure does not exist.

    Attributes:
        psnr: dB
        flip: Mean FLIP, 0..1
        has_flip: Whether that was measured.
    """

    frame_index: int
    camera_index: int
    psnr: float | None
    flip: float | None
    has_flip: bool = True


@dataclass(frozen=True, slots=True)
class PairFigures:
    """Figures of two neighbouring frames of one camera, by the later one. None where a figure does not exist.

    Attributes:
        excess: Mean E over all pixels, 0..1
        excess_static, change_static: Mean E and mean R over static pixels, 0..1
    """

    frame_index: int
    camera_index: int
    excess: float | None
    excess_static: float | None
    change_static: float | None


@dataclass(frozen=True, slots=True)
class ClipMeasurements:
    """Figures of one clip."""

    clip_index: int
    rows: Sequence[RowFigures] = ()
    pairs: Sequence[PairFigures] = ()


def mean_excess(pair: PairRow) -> float | None:
    """Mean E over all pixels, that of the map of E, from the means over both parts; None where there is none."""
    parts = ((pair.static_share, pair.excess_static), (1.0 - pair.static_share, pair.excess_moving))
    known = [share * value for share, value in parts if value is not None]
    return sum(known) if known else None


def row_figures(row: EvalRow, camera_index: int, *, has_flip: bool = True) -> RowFigures:
    """A row's figures for the window. has_flip: Whether FLIP was measured."""
    return RowFigures(row.frame_index, camera_index, row.figures["psnr"], row.figures["flip"], has_flip)


def pair_figures(pair: PairRow, camera_index: int) -> PairFigures:
    """A pair's figures for the window."""
    return PairFigures(pair.frame_index, camera_index, mean_excess(pair), pair.excess_static, pair.change_static)


def _known(values: np.ndarray) -> list[float]:
    return values[np.isfinite(values)].tolist()


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


@dataclass(slots=True)
class Figures:
    """Arrays over all frames and cameras. For one thread.

    Attributes:
        clips: Of the project.
        n_cameras: Of the capture.
        is_usable: Pictures that can be measured, because they are not excluded; None for all. [F, C] bool
        cells: By column of CELL_COLUMNS, NaN where not known. [F, C] float64
        has_psnr, has_row, has_pair: Whether it was measured, even without a figure; quick rows have PSNR alone.
            [F, C] bool
        is_wanted: Frames of trained clips. [F] bool
        is_wanted_pair: Frames whose pair with the frame before can be measured. [F] bool
        seams: One per boundary between clips.
        revision: Grows with every change.
    """

    clips: Sequence[Clip]
    n_cameras: int
    is_usable: np.ndarray | None = None
    cells: dict[str, np.ndarray] = field(init=False)
    has_psnr: np.ndarray = field(init=False)
    has_row: np.ndarray = field(init=False)
    has_pair: np.ndarray = field(init=False)
    is_wanted: np.ndarray = field(init=False)
    is_wanted_pair: np.ndarray = field(init=False)
    seams: list[SeamStatus] = field(init=False)
    revision: int = 0
    _usable: np.ndarray = field(init=False)
    _usable_pair: np.ndarray = field(init=False)
    _excess_static: np.ndarray = field(init=False)
    _change_static: np.ndarray = field(init=False)
    _stale_seams: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        shape = (self.clips[-1].stop if self.clips else 0, self.n_cameras)
        usable = np.ones(shape, bool) if self.is_usable is None else self.is_usable
        before = np.concatenate([np.zeros((1, self.n_cameras), bool), usable[:-1]])[: shape[0]]
        self._usable, self._usable_pair = usable, usable & before
        self.cells = {column: np.full(shape, np.nan) for column in CELL_COLUMNS}
        self.has_psnr, self.has_row, self.has_pair = (np.zeros(shape, bool) for _ in range(3))
        self.is_wanted, self.is_wanted_pair = (np.zeros(shape[0], bool) for _ in range(2))
        self._excess_static, self._change_static = (np.full(shape, np.nan) for _ in range(2))
        self.seams = [SeamStatus(clip.clip_index, clip.start) for clip in self.clips[1:]]

    def set_trained(self, trained: Iterable[int]) -> None:
        """Set the clips that are trained, and so can be measured."""
        known = set(trained)
        self.is_wanted[:] = self.is_wanted_pair[:] = False
        for clip in self.clips:
            if clip.clip_index in known:
                self.is_wanted[clip.start : clip.stop] = True
                self.is_wanted_pair[clip.start + 1 : clip.stop] = True
                self.is_wanted_pair[clip.start] = clip.clip_index - 1 in known
        self.revision += 1

    def forget(self, clip_index: int) -> None:
        """A clip was trained again, or is gone: nothing of it holds any more, nor the boundary behind it."""
        clip = self.clips[clip_index]
        frames = slice(clip.start, clip.stop)
        for column in CELL_COLUMNS:
            self.cells[column][frames] = np.nan
        self._excess_static[frames] = self._change_static[frames] = np.nan
        self.has_psnr[frames] = self.has_row[frames] = self.has_pair[frames] = False
        if clip.stop < len(self.has_pair):
            for values in (self.cells["E"], self._excess_static, self._change_static):
                values[clip.stop] = np.nan
            self.has_pair[clip.stop] = False
        for later in (clip_index, clip_index + 1):
            if 0 < later < len(self.clips):
                self.seams[later - 1] = SeamStatus(later, self.clips[later].start)
        self._stale_seams |= self._seams_of(clip_index)
        self.revision += 1

    def lacks(self, found: ClipMeasurements) -> bool:
        """Whether something of this is not known yet."""
        rows, pairs = ([(f.frame_index, f.camera_index) for f in figures] for figures in (found.rows, found.pairs))
        return not (all(self.has_row[at] for at in rows) and all(self.has_pair[at] for at in pairs))

    def take(self, found: ClipMeasurements) -> None:
        """Take in figures of a clip. Known ones are overwritten."""
        for row in found.rows:
            at = row.frame_index, row.camera_index
            self.cells["psnr"][at] = _number(row.psnr)
            self.has_psnr[at] = True
            if row.has_flip:
                self.cells["flip"][at] = _number(row.flip)
                self.has_row[at] = True
        for pair in found.pairs:
            at = pair.frame_index, pair.camera_index
            self.cells["E"][at] = LEVELS * _number(pair.excess)
            self._excess_static[at] = _number(pair.excess_static)
            self._change_static[at] = _number(pair.change_static)
            self.has_pair[at] = True
        if found.pairs:
            self._stale_seams |= self._seams_of(found.clip_index)
        self.revision += 1

    def _seams_of(self, clip_index: int) -> set[int]:
        """Boundaries, by the later clip, whose score depends on pairs of a clip."""
        return {later for later in (clip_index, clip_index + 1) if 0 < later < len(self.clips)}

    def score_seams(self) -> None:
        """Make some of the scores anew that have changed; call it again while `has_stale_seams`."""
        for later in sorted(self._stale_seams)[:N_SEAMS_PER_CALL]:
            self._stale_seams.discard(later)
            self.seams[later - 1] = self._seam(later)
            self.revision += 1

    @property
    def has_stale_seams(self) -> bool:
        """Whether there are scores to be made anew."""
        return bool(self._stale_seams)

    def _seam(self, later: int) -> SeamStatus:
        before, after = self.clips[later - 1], self.clips[later]
        inside = np.r_[before.start + 1 : before.stop, after.start + 1 : after.stop]
        interior = self._excess_static[inside]
        scores: dict[int, float] = {}
        for camera in np.flatnonzero(np.isfinite(self._excess_static[after.start])):
            score = score_of(float(self._excess_static[after.start, camera]), _known(interior[:, camera]))
            if score is not None:
                scores[int(camera)] = score
        ratio = ratio_of(_known(self._change_static[after.start]), _known(self._change_static[inside]))
        is_seen = self._usable_pair[after.start]
        around = np.r_[inside, after.start]
        is_in = is_seen & (self.has_pair[around] | ~self._usable_pair[around]).all(0)
        worst = max(scores, key=lambda camera: scores[camera], default=None)
        score = mean_of(list(scores.values()))
        return SeamStatus(later, after.start, score, ratio, int(is_in.sum()), int(is_seen.sum()), worst)

    def held_out_psnr(self, holdout: Sequence[int]) -> list[float | None]:
        """Mean PSNR of each clip's frames in the held-out cameras, dB, as in an evaluation. None until every
        one of them is measured, and without held-out cameras."""
        cameras = sorted(holdout)
        if not cameras:
            return [None] * len(self.clips)
        values = self.cells["psnr"][:, cameras]
        is_in = (self.has_psnr | ~self._usable)[:, cameras].all(1) & self.is_wanted
        frames = [slice(clip.start, clip.stop) for clip in self.clips]
        return [mean_of(_known(values[found].T)) if is_in[found].all() else None for found in frames]

    # ---------------------------------------------------------------- missing figures

    @property
    def incomplete(self) -> list[int]:
        """Clips of which something is not measured."""
        unknown = self.unknown_rows | self.unknown_pairs
        return [clip.clip_index for clip in self.clips if unknown[clip.start : clip.stop].any()]

    @property
    def measured(self) -> dict[str, tuple[int, int]]:
        """By column of CELL_COLUMNS: of how many pictures it is measured, and of how many it can be."""
        rows, pairs = self._usable & self.is_wanted[:, None], self._usable_pair & self.is_wanted_pair[:, None]
        known = {"psnr": (self.has_psnr, rows), "flip": (self.has_row, rows), "E": (self.has_pair, pairs)}
        return {column: (int((has & wanted).sum()), int(wanted.sum())) for column, (has, wanted) in known.items()}

    @property
    def n_all(self) -> int:
        """Pictures of trained clips that can be measured."""
        return int((self._usable & self.is_wanted[:, None]).sum())

    @property
    def n_done(self) -> int:
        """Those that are measured, with their pair."""
        return self.n_all - int((self.unknown_rows | self.unknown_pairs).sum())

    @property
    def unknown_rows(self) -> np.ndarray:
        """Pictures that are not measured. [F, C] bool"""
        return ~self.has_row & self.is_wanted[:, None] & self._usable

    @property
    def unknown_pairs(self) -> np.ndarray:
        """Pairs that are not measured, by the later frame. [F, C] bool"""
        return ~self.has_pair & self.is_wanted_pair[:, None] & self._usable_pair
