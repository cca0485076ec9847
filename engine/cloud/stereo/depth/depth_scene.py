"""The inputs and checks of depth maps: small pictures of all cameras at one moment, and their neighbours.

Letters: C cameras, H W full pictures, h w working pictures (about 160 x 90).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from engine.camera.depth_range import near_plane
from engine.camera.rig import CameraRig
from engine.cloud.background.gains import gains_from_pictures
from engine.cloud.kept_results import Arrays, Keep, do_now
from engine.cloud.stereo.depth.consistency import DepthAgreement, check_depths
from engine.cloud.stereo.depth.fill import fill_inverse_depth
from engine.cloud.stereo.depth.slanted import N_SCANS, refine_slanted
from engine.cloud.stereo.depth.smoothing import smooth_inverse_depth
from engine.cloud.stereo.depth.sweep import UNKNOWN_COST, matching_costs, plane_inverse_depths
from engine.images.image_filters import block_mean, erode
from engine.parallel import map_ordered

WORKING_PIXELS = 160 * 90
"""Depth maps of about this many pixels; larger ones make the cloud no better."""
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
class DepthScene:
    """The data of all steps after the sweep.

    Attributes:
        greys: White-balanced. [C, h, w] float32
        is_usable: The background can be trusted there. [C, h, w] bool
        rig: At working size.
        sources: Neighbours of each camera.
        near, far: Depths that are searched. [C]
        gains: First guess of the white balance, taken out of the greys. [C, 3]
    """

    greys: np.ndarray
    is_usable: np.ndarray
    rig: CameraRig
    sources: list[list[int]]
    near: np.ndarray
    far: np.ndarray
    gains: np.ndarray

    def checked(self, depths: np.ndarray, tolerance: float) -> list[DepthAgreement]:
        """The neighbours' check of each depth map [C, h, w]."""
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
                if is_alone.any():  # hardly another camera sees surfaces close to one
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

    def refined(
        self,
        seeds: np.ndarray,
        prior: np.ndarray,
        keep: Keep = do_now,
        *,
        is_wanted: np.ndarray | None = None,
        n_scans: int = N_SCANS,
    ) -> np.ndarray:
        """Inverse depths [C, h, w] by slanted patches.

        Args:
            seeds: Inverse depths to begin with. [N, C, h, w]
            prior: Inverse depth that pixels without texture stay near. [C, h, w]
            is_wanted: Pixels to be refined; the others stay what the first seed says. None for all. [C, h, w] bool
            n_scans: Passes over each picture.
        """

        def refine_one(camera: int) -> np.ndarray:
            return refine_slanted(
                self.greys,
                self.is_usable,
                self.rig,
                camera=camera,
                sources=self.sources[camera],
                seeds=seeds[:, camera],
                prior=prior[camera],
                low=1.0 / self.far[camera],
                high=min(NEARER / self.near[camera], 1.0 / near_plane(self.rig)),
                is_wanted=None if is_wanted is None else is_wanted[camera],
                n_scans=n_scans,
            )[0]

        parts = []
        for cameras in _groups(len(self.rig)):
            kept = keep(
                f"slanted patches from {cameras.start}",
                partial(lambda cameras: {"inverse": np.stack(map_ordered(refine_one, cameras))}, cameras),
            )
            parts.append(kept["inverse"])
        return np.concatenate(parts)


@dataclass(frozen=True, slots=True)
class DepthMaps:
    """Complete depth maps at working size and what backs every pixel.

    Attributes:
        scene: The scene they were made of.
        measured: Inverse depths as they were matched, whether or not others agree. [C, h, w] float64
        depths: Camera z, positive everywhere. [C, h, w] float64
        is_agreed: At least two other cameras measured the same depth. [C, h, w] bool
        checks: Agreement of the completed maps, one per camera.
    """

    scene: DepthScene
    measured: np.ndarray
    depths: np.ndarray
    is_agreed: np.ndarray
    checks: list[DepthAgreement]

    @classmethod
    def of(cls, scene: DepthScene, measured: np.ndarray) -> DepthMaps:
        """Inverse depths [C, h, w], checked and completed."""
        is_agreed, depths = scene.completed(measured)
        return cls(scene, measured, depths, is_agreed, scene.checked(depths, FILLED_TOLERANCE))

    @property
    def rig(self) -> CameraRig:
        """At working size."""
        return self.scene.rig

    @property
    def is_usable(self) -> np.ndarray:
        """The pictures can be trusted there. [C, h, w] bool"""
        return self.scene.is_usable


def _working_factor(width: int, height: int, n_pixels: int) -> int:
    """Integer shrink factor that comes closest to n_pixels."""
    return max(1, round(float(np.sqrt(width * height / n_pixels))))


def prepared(
    backgrounds: np.ndarray, is_stable: np.ndarray, rig: CameraRig, n_pixels: int, gains: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, CameraRig, np.ndarray]:
    """White-balanced greys [C, h, w], usable pixels [C, h, w], rig at that size and first gains [C, 3].

    Args:
        backgrounds, is_stable, rig: As in build_static_cloud.
        n_pixels: About as many the greys have.
        gains: First gains, where they are known. [C, 3]
    """
    height, width = backgrounds.shape[1:3]
    factor = _working_factor(width, height, n_pixels)
    pictures = np.stack([block_mean(picture, factor) for picture in backgrounds])
    shares = np.stack([block_mean(stable, factor) for stable in is_stable])
    is_usable = np.stack([erode(share > 0.6, 1) for share in shares])
    gains = gains_from_pictures(pictures, is_usable) if gains is None else gains
    greys = ((pictures / gains[:, None, None]) @ GREY_FROM_RGB).astype(np.float32)
    cut_sizes = np.array([[width // factor * factor, height // factor * factor]])
    cut = CameraRig(rig.names, rig.world_to_camera, rig.Ks, np.repeat(cut_sizes, len(rig), axis=0))
    return greys, is_usable, cut.resized(cut.image_sizes // factor), gains


def sweep_all(
    greys: np.ndarray,
    is_usable: np.ndarray,
    rig: CameraRig,
    sources: list[list[int]],
    near: np.ndarray,
    far: np.ndarray,
    keep: Keep = do_now,
    *,
    known: np.ndarray | None = None,
) -> tuple[np.ndarray, list[int]]:
    """Smoothed inverse depth of every camera [C, h, w] float64 and the planes each one used.

    Args:
        known: Inverse depths that need not be found; NaN where they are wanted. None for all. [C, h, w]
    """

    def sweep_one(camera: int) -> tuple[np.ndarray, int]:
        planes = plane_inverse_depths(rig, camera, sources[camera], near[camera], far[camera])
        is_wanted = None if known is None else np.isnan(known[camera])
        costs = matching_costs(
            greys,
            is_usable,
            rig,
            camera=camera,
            sources=sources[camera],
            inverse_depths=planes,
            is_wanted=is_wanted,
        )
        if known is not None and is_wanted is not None:
            nearest = np.rint((known[camera] - planes[0]) / (planes[1] - planes[0]))  # they are uniform
            y, x = np.nonzero(~is_wanted)
            costs[~is_wanted] = UNKNOWN_COST
            costs[y, x, np.clip(nearest[y, x], 0, len(planes) - 1).astype(np.int64)] = 0.0
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


def _groups(n_cameras: int) -> list[range]:
    """Cameras whose depth maps are kept together."""
    return [range(first, min(first + KEPT_CAMERAS, n_cameras)) for first in range(0, n_cameras, KEPT_CAMERAS)]
