"""Points about where anchors come from: cameras, point clouds, deduplication."""

from __future__ import annotations

from engine.training.published.point import Point

CLOUDS = (
    Point("frames of a clip", "released code", paper="M, of no stated size", released="10"),
    Point(
        "frames of the point clouds",
        "both",
        paper="all frames of the clip, with what stands still, for reference and source clips alike",
        settings={"cloud": "frames", "backgrounds": "clip"},
    ),
    Point(
        "cameras and pictures",
        "neither",
        paper="poses by COLMAP",
        released="COLMAP on one frame, focal lengths rounded down to whole pixels, pictures undistorted and saved "
        "as JPEG",
        here="as a calibrated capture has them, or by `clipgstream calibrate`; pictures as they were recorded",
        reason="captures come calibrated by many programs; rounding and saving again only lose",
    ),
    Point(
        "stereo",
        "neither",
        paper="COLMAP",
        released="COLMAP's PatchMatch for every frame, and its fusion; such clouds come with its captures",
        here="our own, at about 160 x 90 pixels: a plane sweep and slanted patches, in a later frame only where its "
        "picture differs from that of the clip's first one; only what other cameras agree with is kept; clouds that "
        "come along are not used",
        reason="COLMAP's PatchMatch needs CUDA, and clouds of all clips would have to come along",
        settings={"cloud": "frames"},
    ),
    Point(
        "noise of the point clouds",
        "neither",
        released="points stay where the fusion puts them",
        here="those of a frame are moved twice onto the mean planes of 20 neighbours, before frames are merged",
        reason="depth maps this small are noisier than COLMAP's",
        settings={"cloud": "frames"},
    ),
    Point(
        "density of the point clouds",
        "neither",
        released="one point per voxel of 0.012 scene units; a later frame adds points to empty voxels only; points "
        "more than some 3 units from their neighbours are left out",
        here="likewise, with voxels of 4 pixels at the median depth, larger where more than two million anchors would "
        "come of them; statistical outliers are left out",
        reason="0.012 means something else in every scene",
        settings={"max_static_points": 1_000_000, "max_moving_points": 1_000_000},
    ),
    Point(
        "deduplication",
        "paper",
        paper="outside of the union of spheres around all anchors of the reference clip, with the mean distance to "
        "three neighbours as radius",
        released="at least 0.005 scene units outside of the sphere around the nearest one, with the root mean "
        "square as radius; the points before training",
        here="the exact union; the anchors where training has put them",
        reason="the paper comes first; a nearest centre is not the union, and 0.005 means something else in every "
        "scene",
        settings={"residual": "dedup"},
    ),
    Point(
        "scales of residual anchors at their start",
        "neither",
        released="by mistake those of as many anchors of the reference clip",
        here="the distance to three neighbours among all anchors of the clip",
        reason="it is plainly a mistake: rows of the wrong cloud",
        settings={"initial": "published"},
    ),
)
