"""The gate from the pictures: which static anchors change over time in a clip, by how much, and why it is believed.

A camera's picture is compared with its own background at the footprint of every anchor that it sees unhidden, in log
colour, after that camera's exposure of the frame is removed. Camera by camera a change counts where it stands out of
the camera's own noise; for the anchor it counts only where at least two cameras, and half of those that see it, tell
of the same change at the same time. So noise, one camera's drift, and people who pass in front of one of them move
nothing. What lies near a hull is left to the moving anchors, which are there already.

Measured on real pictures at half size (27 and 18 cameras, six frames): a lamp painted into the pictures, 10 to 40 %
brighter or 20 % darker, on three to four anchor spacings around a point promotes 37 of 37 and 55 to 61 of 61 anchors
inside and none outside, with and without each camera drifting by up to 4 % a frame; no anchor without the lamp.

A change of the light that covers most of what a camera sees is exposure here: nothing in one camera's pictures can
tell the two apart.
Letters: M frames of the clip, C cameras, A anchors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import KDTree

from engine.camera.projection import is_in_picture, project, projection_matrices
from engine.camera.rig import CameraRig
from engine.cloud.median import median_over_cameras
from engine.gate.reasons import ALONE, CHANGES, LIGHT, NEAR_MOTION, ONE_VIEW, REASONS, STILL, UNSEEN
from engine.parallel import map_ordered, n_cores

MIN_CHANGE = 0.06
"""Smallest change that counts, in log colour: 6 %, about what a motion mask asks for on a mid-grey wall."""
NOISE_FACTOR = 5.0
"""A change counts from this many standard deviations of the camera's noise at that brightness."""
MIN_VIEWS = 2
MIN_SHARE = 0.5
"""Of the views that see an anchor unhidden in a frame, this share has to tell of the change."""
MIN_FRAMES = 2
"""Frames of the clip in which it has to be seen (one in a clip of one frame)."""
TONE_SPREAD = 0.35
"""A change whose channels differ from their mean by no more than this share of it is one of brightness."""
LEVEL_OFFSET = 16.0
"""Added before the logarithm, grey levels: below it differences are noise, not ratios."""
SATURATED = 250.0
N_NOISE_BINS = 4
MIN_SAMPLES = 32
"""Fewer anchors in a brightness bin say nothing about its noise, and fewer in a picture nothing about exposure."""
ALONE_SPACINGS = 2.0
"""Light falls on more than one anchor: without another one within this, a change is taken for chance. One of 14,724
anchors of a dome without lamps was such a case."""
NEAR_SPACINGS = 2.5
"""A moving point this near, in the larger of the two clouds' spacings, takes an anchor over."""
MAX_RADIUS_PX = 4
_CHI3_MEDIAN = 0.888  # median of the rms of three independent normal values


@dataclass(frozen=True, slots=True)
class GateTable:
    """What was decided of each static anchor.

    Attributes:
        is_dynamic: Whether it needs a dynamic feature in this clip. [A] bool
        reasons: Code, see engine.gate.reasons. [A] uint8
        scores: Largest change that enough views agree on, in units of what counts: from 1 up it does. [A] float32
    """

    is_dynamic: np.ndarray
    reasons: np.ndarray
    scores: np.ndarray

    def summary(self) -> str:
        """How many anchors of which reason, in one line."""
        counts = np.bincount(self.reasons, minlength=len(REASONS))
        return "; ".join(f"{n} {words}" for n, words in zip(counts, REASONS, strict=True) if n)


def measure_gate(
    frames: Callable[[int, int], np.ndarray],
    n_frames: int,
    backgrounds: np.ndarray,
    rig: CameraRig,
    points: np.ndarray,
    *,
    spacing: float,
    moving_points: np.ndarray,
    presence: np.ndarray,
    moving_spacing: float,
) -> GateTable:
    """Decide for every static anchor whether it changes in this clip.

    Args:
        frames: (row of the rig, frame_in_clip) -> picture [H, W, 3] uint8.
        n_frames: M
        backgrounds: What each camera sees when nothing moves; what static anchors were trained on. [C, H, W, 3] uint8
        rig: Training cameras, at the size of the pictures.
        points: Static anchors, scene units. [A, 3]
        spacing: Distance between them, scene units.
        moving_points: Surface points of what moves in this clip; they hide and take over anchors. [P, 3]
        presence: Frames they exist in. [P, M] bool
        moving_spacing: Distance between them, scene units.
    Returns:
        GateTable. Same for any number of threads.
    """
    points = np.asarray(points, dtype=np.float64)
    sights = [_Sight.of(camera, backgrounds, rig, points, spacing) for camera in range(len(rig))]
    thresholds = np.stack(map_ordered(lambda s: _thresholds(s, frames, n_frames), sights))  # [C, A]
    n_changed, n_alone, n_seen = np.zeros((3, len(points)), dtype=np.int64)
    scores, sums = np.zeros(len(points), dtype=np.float32), np.zeros((len(points), 3))
    for frame in range(n_frames):
        alive = np.asarray(moving_points[presence[:, frame]], dtype=np.float64)

        def look(sight: _Sight, frame: int = frame, alive: np.ndarray = alive) -> np.ndarray:
            changes = sight.changes(frames(sight.camera, frame))
            changes[sight.is_hidden_by(alive, moving_spacing, margin=2.0 * spacing)] = np.nan
            return changes

        changes = np.stack(map_ordered(look, sights))  # [C, A, 3], NaN where hidden
        ratios = np.sqrt((changes**2).mean(axis=2)) / thresholds  # [C, A]
        is_seen = np.isfinite(ratios)
        is_loud = is_seen & (ratios >= 1.0)
        medians = median_over_cameras(np.where(is_loud[..., None], changes, np.nan))
        alike = is_loud & (((changes - medians) ** 2).sum(axis=2) <= 0.25 * (medians**2).sum(axis=1))
        needed = np.maximum(MIN_VIEWS, np.ceil(MIN_SHARE * is_seen.sum(axis=0)))
        is_changed = alike.sum(axis=0) >= needed
        levels = np.where(alike, ratios, 0.0)
        mean_levels = levels.sum(axis=0) / np.maximum(alike.sum(axis=0), 1)
        scores = np.maximum(scores, np.where(is_changed, mean_levels, 0.0)).astype(np.float32)
        n_changed += is_changed
        n_alone += is_loud.any(axis=0) & ~is_changed
        n_seen += is_seen.sum(axis=0) >= MIN_VIEWS
        # lamps go on and off: directions of change are compared on one side of zero
        side = np.sign(medians.sum(axis=1))[:, None]
        sums += np.where(is_changed[:, None], medians * side, 0.0)
    needed_frames = min(MIN_FRAMES, n_frames)
    is_dynamic = n_changed >= needed_frames
    tones = sums.mean(axis=1)
    is_tone = np.abs(sums - tones[:, None]).max(axis=1, initial=0.0) <= TONE_SPREAD * np.abs(tones)
    reasons = np.full(len(points), STILL, dtype=np.uint8)
    reasons[n_alone >= needed_frames] = ONE_VIEW
    reasons[n_seen == 0] = UNSEEN
    reasons[is_dynamic] = np.where(is_tone, LIGHT, CHANGES)[is_dynamic]
    is_alone = is_dynamic.copy()
    is_alone[is_dynamic] = _are_alone(points[is_dynamic], ALONE_SPACINGS * spacing)
    reasons[is_alone] = ALONE
    is_near = is_dynamic & _is_near(points, moving_points, NEAR_SPACINGS * max(spacing, moving_spacing))
    reasons[is_near] = NEAR_MOTION
    return GateTable(is_dynamic & ~is_near & ~is_alone, reasons, scores)


def _are_alone(points: np.ndarray, reach: float) -> np.ndarray:
    """Points without another one within reach. [P] bool"""
    if len(points) < 2:
        return np.ones(len(points), dtype=bool)
    distances, _ = KDTree(points).query(points, 2, workers=n_cores())
    return np.asarray(distances[:, 1] > reach)


def _is_near(points: np.ndarray, others: np.ndarray, reach: float) -> np.ndarray:
    if len(others) == 0 or len(points) == 0:
        return np.zeros(len(points), dtype=bool)
    distances, _ = KDTree(others).query(points, distance_upper_bound=reach, workers=n_cores())
    return np.asarray(np.isfinite(distances))


@dataclass(frozen=True, slots=True)
class _Sight:
    """What one camera sees of the static anchors when nothing moves.

    Attributes:
        camera: Row of the rig.
        projection: [3, 4]
        focal: Pixels.
        shape: Of its pictures: height, width.
        pixels: Column and row of each anchor. [A, 2] int64; -1 where it is not seen
        depths: [A]
        radius: Half width of the footprint, pixels.
        empty: Background at the footprints. [A, 3]
    """

    camera: int
    projection: np.ndarray
    focal: float
    shape: tuple[int, int]
    pixels: np.ndarray
    depths: np.ndarray
    radius: int
    empty: np.ndarray

    @staticmethod
    def of(camera: int, backgrounds: np.ndarray, rig: CameraRig, points: np.ndarray, spacing: float) -> _Sight:
        height, width = backgrounds.shape[1:3]
        projection = projection_matrices(rig)[camera]
        focal = float(np.sqrt(rig.Ks[camera, 0, 0] * rig.Ks[camera, 1, 1]))
        pixels, depths = project(points, projection)
        nearest = _nearest_depths(pixels, depths, 0.6 * focal * spacing, 0.0, (height, width))
        is_inside = is_in_picture(pixels, depths, width, height)
        columns = np.where(is_inside[:, None], pixels, 0.0).astype(np.int64)
        # surfaces seen at a slant: the squares of their nearer points cover the farther ones
        is_front = is_inside & (depths <= nearest[columns[:, 1], columns[:, 0]] + 3.0 * spacing)
        columns[~is_front] = -1
        footprint = focal * spacing / np.median(depths[is_front]) if is_front.any() else 0.0
        radius = int(np.clip(round(0.4 * footprint), 0, MAX_RADIUS_PX))
        empty = np.full((len(points), 3), np.nan)
        _block_means(backgrounds[camera], columns, radius, empty)
        return _Sight(camera, projection, focal, (height, width), columns, depths, radius, empty)

    def changes(self, picture: np.ndarray) -> np.ndarray:
        """Log colour against the background, exposure removed; NaN for anchors that are not seen. [A, 3]"""
        seen = np.full(self.empty.shape, np.nan)
        _block_means(picture, self.pixels, self.radius, seen)
        lit = (self.empty > 24.0) & (self.empty < 230.0) & (seen < SATURATED)
        gains = np.ones(3)
        for channel in range(3):
            is_lit = lit[:, channel]
            ratios = seen[is_lit, channel] / self.empty[is_lit, channel]
            if len(ratios) >= MIN_SAMPLES:
                gains[channel] = np.median(ratios)
        expected = np.minimum(self.empty * gains, 255.0)
        # where the background was saturated its true colour is unknown: anything up to white is as expected
        highest = np.where(self.empty >= SATURATED, 255.0, expected)
        return np.log(seen + LEVEL_OFFSET) - np.log(np.clip(seen, expected, highest) + LEVEL_OFFSET)

    def is_hidden_by(self, moving: np.ndarray, spacing: float, *, margin: float) -> np.ndarray:
        """Anchors behind something that moves, by at least this margin in scene units. moving: [n, 3]; gives [A]"""
        if len(moving) == 0:
            return np.zeros(len(self.depths), dtype=bool)
        pixels, depths = project(moving, self.projection)
        # two pixels more than the points themselves: outlines are soft, and masks end inside them
        nearest = _nearest_depths(pixels, depths, self.focal * spacing, 2.0 + self.radius, self.shape)
        return np.asarray(nearest[self.pixels[:, 1], self.pixels[:, 0]] < self.depths - margin)


def _thresholds(sight: _Sight, frames: Callable[[int, int], np.ndarray], n_frames: int) -> np.ndarray:
    """What counts as a change, from one camera's own noise by brightness, per anchor. Median, so that what moves does
    not count while it is less than half. [A]"""
    chosen = np.unique(np.linspace(0, n_frames - 1, min(n_frames, 8)).round().astype(int))
    changes = np.stack([sight.changes(frames(sight.camera, int(frame))) for frame in chosen])
    sizes = np.sqrt((changes**2).mean(axis=2))  # [frames, A]
    brightness = np.where(np.isfinite(sight.empty[:, 0]), sight.empty.mean(axis=1), 0.0)
    bins = np.minimum(brightness / (256.0 / N_NOISE_BINS), N_NOISE_BINS - 1).astype(int)
    overall = sizes[np.isfinite(sizes)]
    noise = np.full(N_NOISE_BINS, np.median(overall) if len(overall) else 0.0)
    for i in range(N_NOISE_BINS):
        members = sizes[:, bins == i]
        members = members[np.isfinite(members)]
        if len(members) >= MIN_SAMPLES:
            noise[i] = np.median(members)
    return np.maximum(MIN_CHANGE, NOISE_FACTOR * noise[bins] / _CHI3_MEDIAN)


def _nearest_depths(
    pixels: np.ndarray, depths: np.ndarray, size_px: float, extra_px: float, shape: tuple[int, int]
) -> np.ndarray:
    """Smallest depth per pixel of points drawn as squares of half width size_px / depth + extra_px; inf where none."""
    nearest = np.full(shape, np.inf)
    columns = np.where((depths > 0.0)[:, None], np.clip(pixels, -1e6, 1e6), -1e6).astype(np.int64)
    _splat(columns, np.ascontiguousarray(depths), size_px, extra_px, nearest)
    return nearest


@njit(cache=True, nogil=True, error_model="numpy")
def _splat(pixels, depths, size_px, extra_px, nearest):
    height, width = nearest.shape
    for p in range(len(depths)):
        depth = depths[p]
        if depth <= 0.0:
            continue
        half = int(min(size_px / depth + extra_px, 0.25 * width) + 0.5)
        x, y = pixels[p, 0], pixels[p, 1]
        for row in range(max(y - half, 0), min(y + half + 1, height)):
            for column in range(max(x - half, 0), min(x + half + 1, width)):
                if depth < nearest[row, column]:
                    nearest[row, column] = depth


@njit(cache=True, nogil=True, error_model="numpy")
def _block_means(picture, pixels, radius, means):
    """Mean colour of the square around each pixel, cut at the border; rows with a negative pixel stay as they are."""
    height, width, _ = picture.shape
    for p in range(len(pixels)):
        x, y = pixels[p, 0], pixels[p, 1]
        if x < 0 or y < 0:
            continue
        red, green, blue, n = np.int64(0), np.int64(0), np.int64(0), 0
        for row in range(max(y - radius, 0), min(y + radius + 1, height)):
            for column in range(max(x - radius, 0), min(x + radius + 1, width)):
                red += picture[row, column, 0]
                green += picture[row, column, 1]
                blue += picture[row, column, 2]
                n += 1
        means[p, 0] = red / n
        means[p, 1] = green / n
        means[p, 2] = blue / n
