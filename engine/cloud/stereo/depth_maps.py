"""Depth maps of all backgrounds: a sweep of planes, then slanted patches, each checked by other cameras and filled.

Letters: C cameras, H W full pictures, h w working pictures (about 160 x 90).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from engine.camera.depth_range import MIN_POINTS, depth_ranges, focus_distances, near_plane
from engine.camera.rig import CameraRig
from engine.cloud.background.gains import gains_from_pictures
from engine.cloud.keeping import Arrays, Keep, do_now
from engine.cloud.stereo.consistency import Agreement, check_depths
from engine.cloud.stereo.fill import fill_inverse_depth
from engine.cloud.stereo.slanted import refine_slanted
from engine.cloud.stereo.smoothing import smooth_inverse_depth
from engine.cloud.stereo.sweep import choose_sources, matching_costs, plane_inverse_depths
from engine.images.image_filters import block_mean, erode
from engine.parallel import map_ordered

Report = Callable[[str], None]

WORKING_PIXELS = 160 * 90
"""Depth maps of about this many pixels; larger ones make the cloud no better."""
PROBE_PIXELS = 80 * 45
"""Size of the first look that finds the depth range where there are no sparse points."""
PROBE_RANGE = (0.3, 12.0)
"""Depths of that first look, in focus distances; far planes cost little in inverse depth."""
GREY_FROM_RGB = np.array([0.299, 0.587, 0.114])
AGREE_TOLERANCE = 0.02
FILLED_TOLERANCE = 0.04
MIN_AGREE = 2
ALONE_WEIGHT = 0.3
"""Trust in a pixel that one other camera agrees with and none looks through: nine of ten of those are right."""
MIN_AGREED_PIXELS = 100
"""With fewer agreed pixels their range says nothing about the rest of the picture."""
NEARER = 1.5
"""Slanted patches may come nearer than the sweep by this factor: what stands close to one camera only is rare in the
points and pictures that set the range of the sweep."""
KEPT_CAMERAS = 8
"""Depth maps that are kept together: some seconds of work, and enough of them for every core."""


@dataclass(frozen=True, slots=True)
class DepthMaps:
    """Complete depth maps at working size and what backs every pixel.

    Attributes:
        rig: At working size.
        depths: Camera z, positive everywhere. [C, h, w] float64
        is_agreed: At least two other cameras measured the same depth. [C, h, w] bool
        checks: Agreement of the completed maps, one per camera.
        is_usable: The background can be trusted there. [C, h, w] bool
        near, far: Depths that were searched. [C]
    """

    rig: CameraRig
    depths: np.ndarray
    is_agreed: np.ndarray
    checks: list[Agreement]
    is_usable: np.ndarray
    near: np.ndarray
    far: np.ndarray


def estimate_depth_maps(
    backgrounds: np.ndarray,
    is_stable: np.ndarray,
    rig: CameraRig,
    *,
    sparse_points: np.ndarray | None,
    report: Report,
    keep: Keep = do_now,
    ranges: tuple[np.ndarray, np.ndarray] | None = None,
) -> tuple[np.ndarray, DepthMaps]:
    """First gains [C, 3] and a complete, checked depth map per camera.

    Args:
        ranges: Nearest and farthest depth per camera [C], where they are known. The others: as in build_static_cloud.
    """
    started = time.perf_counter()

    def search() -> Arrays:
        near, far = _search_ranges(backgrounds, is_stable, rig, sparse_points, report)
        return {"near": near, "far": far}

    if ranges is None:
        kept = keep("depth range", search)
        ranges = kept["near"], kept["far"]
    near, far = ranges
    greys, is_usable, small_rig, gains = _prepare(backgrounds, is_stable, rig, WORKING_PIXELS)
    sources = choose_sources(small_rig, near, far)
    inverse, n_planes = _sweep_all(greys, is_usable, small_rig, sources, near, far, keep)
    height, width = greys.shape[1:]
    report(
        f"Depth sweep: {len(rig)} cameras at {width} x {height}, {min(n_planes)}-{max(n_planes)} planes of at most "
        f"1 px, {np.mean([len(s) for s in sources]):.1f} neighbours each ({time.perf_counter() - started:.1f} s)"
    )
    started = time.perf_counter()
    scene = _Scene(greys, is_usable, small_rig, sources, near, far)
    swept, depths = scene.completed(inverse)
    inverse = scene.better(scene.refined(inverse, depths, keep), inverse)
    is_agreed, depths = scene.completed(inverse)
    checks = scene.checked(depths, FILLED_TOLERANCE)
    report(
        f"Slanted patches: from {swept.mean():.0%} to {is_agreed.mean():.0%} of pixels agree with {MIN_AGREE} or more "
        f"neighbours within {AGREE_TOLERANCE:.0%}; the rest filled by a thin plate "
        f"({time.perf_counter() - started:.1f} s)"
    )
    return gains, DepthMaps(small_rig, depths, is_agreed, checks, is_usable, near, far)


@dataclass(frozen=True, slots=True)
class _Scene:
    """What all steps after the sweep look at.

    Attributes:
        greys: White-balanced. [C, h, w] float32
        is_usable: The background can be trusted there. [C, h, w] bool
        rig: At working size.
        sources: Neighbours of each camera.
        near, far: Depths that were searched. [C]
    """

    greys: np.ndarray
    is_usable: np.ndarray
    rig: CameraRig
    sources: list[list[int]]
    near: np.ndarray
    far: np.ndarray

    def checked(self, depths: np.ndarray, tolerance: float) -> list[Agreement]:
        """What the neighbours say about each depth map [C, h, w]."""
        return map_ordered(
            lambda camera: check_depths(
                depths, self.rig, camera=camera, others=self.sources[camera], tolerance=tolerance
            ),
            range(len(self.rig)),
        )

    def completed(self, inverse: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which pixels neighbours agree with [C, h, w] bool, and depths everywhere [C, h, w]."""
        checks = self.checked(1.0 / inverse, AGREE_TOLERANCE)
        is_agreed = np.stack([check.n_agree >= MIN_AGREE for check in checks]) & self.is_usable

        def complete(camera: int) -> np.ndarray:
            check, agreed = checks[camera], is_agreed[camera]
            is_alone = ~agreed & self.is_usable[camera] & (check.n_agree == 1) & (check.n_see_through == 0)
            weights = agreed * np.minimum(check.n_agree, 3) / 3.0 + is_alone * ALONE_WEIGHT
            low, high = 1.0 / self.far[camera], 1.0 / self.near[camera]
            if agreed.sum() >= MIN_AGREED_PIXELS:  # a plate extrapolates freely: keep it within what was measured
                nearest, farthest = np.percentile(check.depths[agreed], [1.0, 99.0])
                if is_alone.any():  # what stands close to a camera, hardly another one sees
                    nearest = min(nearest, float(np.percentile(check.depths[is_alone], 5.0)))
                low, high = max(low, 0.95 / farthest), min(high, 1.1 / nearest)
            filled = fill_inverse_depth(1.0 / check.depths, weights, self.greys[camera], low=low, high=high)
            is_close = (agreed | is_alone) & (np.abs(filled * check.depths - 1.0) < 0.1)
            return np.where(is_close, check.depths, 1.0 / filled)

        return is_agreed, np.stack(map_ordered(complete, range(len(self.rig))))

    def better(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """The first of two inverse depths [C, h, w], but the second where neighbours agree with that one only.

        On bare walls, where patches match everywhere, smoothed costs of the sweep can be right when no patch is.
        """
        is_first, is_second = (
            np.stack([check.n_agree >= MIN_AGREE for check in self.checked(1.0 / inverse, AGREE_TOLERANCE)])
            for inverse in (first, second)
        )
        return np.where(is_second & ~is_first, second, first)

    def refined(self, inverse: np.ndarray, depths: np.ndarray, keep: Keep) -> np.ndarray:
        """Inverse depths [C, h, w] by slanted patches, which begin with those of the sweep and with complete depths."""

        def refine_one(camera: int) -> np.ndarray:
            prior = 1.0 / depths[camera]
            return refine_slanted(
                self.greys,
                self.is_usable,
                self.rig,
                camera=camera,
                sources=self.sources[camera],
                seeds=np.stack([prior, inverse[camera]]),
                prior=prior,
                low=1.0 / self.far[camera],
                high=min(NEARER / self.near[camera], 1.0 / near_plane(self.rig)),
            )[0]

        parts = []
        for cameras in _groups(len(self.rig)):
            kept = keep(
                f"slanted patches from {cameras.start}",
                partial(lambda cameras: {"inverse": np.stack(map_ordered(refine_one, cameras))}, cameras),
            )
            parts.append(kept["inverse"])
        return np.concatenate(parts)


def _groups(n_cameras: int) -> list[range]:
    """Cameras whose depth maps are kept together."""
    return [range(first, min(first + KEPT_CAMERAS, n_cameras)) for first in range(0, n_cameras, KEPT_CAMERAS)]


def _working_factor(width: int, height: int, n_pixels: int) -> int:
    """Integer shrink factor that comes closest to n_pixels."""
    return max(1, round(float(np.sqrt(width * height / n_pixels))))


def _prepare(
    backgrounds: np.ndarray, is_stable: np.ndarray, rig: CameraRig, n_pixels: int
) -> tuple[np.ndarray, np.ndarray, CameraRig, np.ndarray]:
    """White-balanced greys [C, h, w], usable pixels [C, h, w], rig at that size and first gains [C, 3]."""
    height, width = backgrounds.shape[1:3]
    factor = _working_factor(width, height, n_pixels)
    pictures = np.stack([block_mean(picture, factor) for picture in backgrounds])
    shares = np.stack([block_mean(stable, factor) for stable in is_stable])
    is_usable = np.stack([erode(share > 0.6, 1) for share in shares])
    gains = gains_from_pictures(pictures, is_usable)
    greys = ((pictures / gains[:, None, None]) @ GREY_FROM_RGB).astype(np.float32)
    cut_sizes = np.array([[width // factor * factor, height // factor * factor]])
    cut = CameraRig(rig.names, rig.world_to_camera, rig.Ks, np.repeat(cut_sizes, len(rig), axis=0))
    return greys, is_usable, cut.resized(cut.image_sizes // factor), gains


def _search_ranges(
    backgrounds: np.ndarray,
    is_stable: np.ndarray,
    rig: CameraRig,
    sparse_points: np.ndarray | None,
    report: Report,
) -> tuple[np.ndarray, np.ndarray]:
    """Depth range per camera: a coarse sweep over a wide range, stretched towards the sparse points if there are any.

    Points alone are not enough: they lie on texture, and a few wrong ones near a camera would double the planes.
    """
    near, far = depth_ranges(rig, sparse_points)
    point_near, point_far = near.copy(), far.copy()
    n_points = 0 if sparse_points is None else len(sparse_points)
    has_points = n_points >= MIN_POINTS
    distances = focus_distances(rig)
    wide_near = np.maximum(PROBE_RANGE[0] * distances, near_plane(rig))
    wide_far = PROBE_RANGE[1] * distances
    if has_points:
        wide_near, wide_far = np.minimum(wide_near, near), np.maximum(wide_far, far)
    greys, is_usable, small_rig, _ = _prepare(backgrounds, is_stable, rig, PROBE_PIXELS)
    sources = choose_sources(small_rig, wide_near, wide_far)
    inverse, _ = _sweep_all(greys, is_usable, small_rig, sources, wide_near, wide_far)
    depths = 1.0 / inverse
    is_measured = np.zeros(len(rig), dtype=bool)
    for camera in range(len(rig)):
        check = check_depths(depths, small_rig, camera=camera, others=sources[camera], tolerance=0.03)
        seen = check.depths[(check.n_agree >= MIN_AGREE) & is_usable[camera]]
        if len(seen) >= 0.05 * is_usable[camera].size:
            low, high = np.percentile(seen, [2.0, 98.0])
            near[camera] = max(0.8 * low, wide_near[camera])
            far[camera] = max(1.3 * high, 1.5 * near[camera])
            is_measured[camera] = True
    if has_points:
        near = np.where(is_measured, np.minimum(near, np.maximum(point_near, 0.8 * near)), near)
        far = np.where(is_measured, np.maximum(far, np.minimum(point_far, 1.25 * far)), far)
    report(
        f"Depth range: {np.median(near):.3g} to {np.median(far):.3g} scene units (medians over cameras): coarse sweep "
        f"in {is_measured.sum()} of {len(rig)}, the rest from "
        + (f"{n_points} sparse points" if has_points else "the focus distance")
    )
    return near, far


def _sweep_all(
    greys: np.ndarray,
    is_usable: np.ndarray,
    rig: CameraRig,
    sources: list[list[int]],
    near: np.ndarray,
    far: np.ndarray,
    keep: Keep = do_now,
) -> tuple[np.ndarray, list[int]]:
    """Smoothed inverse depth of every camera [C, h, w] float64 and the planes each one used."""

    def sweep_one(camera: int) -> tuple[np.ndarray, int]:
        planes = plane_inverse_depths(rig, camera, sources[camera], near[camera], far[camera])
        costs = matching_costs(greys, is_usable, rig, camera=camera, sources=sources[camera], inverse_depths=planes)
        return smooth_inverse_depth(costs, greys[camera], planes), len(planes)

    def sweep(cameras: range) -> Arrays:
        results = map_ordered(sweep_one, cameras)
        return {
            "inverse": np.stack([result[0] for result in results]),
            "n_planes": np.array([result[1] for result in results]),
        }

    parts = []
    for cameras in _groups(len(rig)):
        parts.append(keep(f"depth maps from {cameras.start}", partial(sweep, cameras)))
    inverse = np.concatenate([part["inverse"] for part in parts]).astype(np.float64)
    return inverse, [int(n) for part in parts for n in part["n_planes"]]
