"""What the published method says, point by point, and what `--preset paper` does about it. Data, no behaviour.

The preset follows the paper where the paper says something, and the released code where it does not. What comes out
differently all the same is a point with a reason. The tables of docs/method.md are generated from here, and tests
compare every point with the preset and with the code.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from engine.training.setting import Value

Follows = Literal["both", "paper", "released code", "neither"]


@dataclass(frozen=True, slots=True)
class Point:
    """One point on which the method can be described.

    Attributes:
        name: Short and unique.
        follows: Whom the preset follows there.
        paper: What the paper says; empty where it is silent.
        released: What the released code does; empty where it does as the paper says.
        here: What is done here; empty where that is as `follows` says.
        reason: Why the paper or the released code has it otherwise; empty where neither has.
        settings: Values in the preset that make it so.
    """

    name: str
    follows: Follows
    paper: str = ""
    released: str = ""
    here: str = ""
    reason: str = ""
    settings: Mapping[str, Value] = field(default_factory=dict)

    @property
    def is_difference(self) -> bool:
        """Whether the paper or the released code has it otherwise."""
        return bool(self.reason)


_MODEL = (
    Point(
        "widths of the features",
        "both",
        paper="64 static and 64 dynamic values an anchor",
        settings={"static_feature_dim": 64, "dynamic_feature_dim": 64},
    ),
    Point(
        "scales of an anchor",
        "released code",
        paper="none: an anchor is a position and two features alone",
        released="six: the unit of its offsets, and that of its Gaussians' sizes",
        here="those six",
        reason="offsets and sizes need a unit, and the paper names no other",
    ),
    Point("Gaussians of an anchor", "released code", released="10", settings={"gaussians_per_anchor": 10}),
    Point(
        "hidden layer of the heads",
        "released code",
        paper="two layers with ReLU, of no stated width",
        released="twice both features: 256",
        settings={"head_hidden": 256},
    ),
    Point("viewing direction", "released code", released="reaches no head: colours are the same from all sides"),
    Point(
        "size of the field",
        "released code",
        paper="a 4D hash grid and a fully fused MLP, of no stated size",
        released="16 levels of 4 values, from 16 cells on and twice as many at every level; 2^17 entries a level by "
        "default and 2^20 for its Long 360 capture; 128 values in the network's hidden layer, no biases",
        settings={
            "field_levels": 16,
            "field_channels": 4,
            "field_base_cells": 16,
            "field_growth": 2.0,
            "field_log2_entries": 17,
            "field_tables": "shared",
            "field_hidden": 128,
        },
    ),
    Point(
        "box and output of the field",
        "released code",
        released="from the first to the last anchor along every axis; the network ends in a ReLU",
        settings={"field_form": "published"},
    ),
    Point(
        "what learning starts from",
        "released code",
        released="features of zero, all scales the distance to three neighbours, entries of the grid within 1e-4, heads "
        "as PyTorch starts any layer; nothing of the colours of the point cloud",
        settings={"initial": "published"},
    ),
    Point(
        "which anchors change over time",
        "both",
        paper="all of them, at every time",
        settings={"gate": "off"},
    ),
    Point("colours of the cameras", "both", paper="those of the scene, for all of them", settings={"color": "off"}),
    Point("stored values", "released code", released="float32, as trained", settings={"storage": "exact"}),
    Point(
        "knots in time",
        "neither",
        paper="a 4D hash grid",
        released="time has as many cells as each axis of space, and 16 corners are interpolated; as there are more cells "
        "than frames, each frame lies in one of its own, between two knots",
        here="time has a knot on every frame, and the 8 corners in space are interpolated there",
        reason="half the entries to read, and what lies between two frames is defined instead of left to chance",
        settings={"field_tables": "shared"},
    ),
    Point(
        "cells of a level",
        "neither",
        released="16 times 2^l less one, shifted by half a cell; a level without hashing if its knots in space and time "
        "fit the table",
        here="16 times 2^l, not shifted; likewise with the frames of the clip as knots in time",
        reason="how tiny-cuda-nn lays out its grid is its own choice, and the grid here is another one",
        settings={"field_base_cells": 16, "field_growth": 2.0},
    ),
    Point(
        "numbers in the field",
        "neither",
        paper="a fully fused MLP",
        released="tiny-cuda-nn: half precision, weights that start as Xavier's",
        here="float32, weights that start within 1 / sqrt(inputs), like those of the heads",
        reason="the library needs CUDA; the kernels here compute in float32",
    ),
    Point(
        "outside of the box",
        "neither",
        released="a dynamic feature of zero",
        here="that of the nearest place in the box",
        reason="positions are learned here, and an anchor that crosses the border must not change at once",
        settings={"field_form": "published"},
    ),
    Point(
        "head of offsets",
        "neither",
        released="four times as wide as both features, 512",
        here="as wide as the other heads, 256",
        reason="the kernels run the four heads as one layer",
        settings={"head_hidden": 256},
    ),
    Point(
        "parts without effect",
        "neither",
        released="a mask network, and offsets, opacities, rotations and a time embedding beside the anchors: stored, and "
        "used by nothing that is shown",
        here="not there",
        reason="they change no picture",
    ),
)

_CLOUDS = (
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
        released="COLMAP on one frame, focal lengths rounded down to whole pixels, pictures undistorted and saved as JPEG",
        here="as a calibrated capture has them, or by `clipgstream calibrate`; pictures as they were recorded",
        reason="captures come calibrated by many programs; rounding and saving again only lose",
    ),
    Point(
        "stereo",
        "neither",
        paper="COLMAP",
        released="COLMAP's PatchMatch for every frame, and its fusion",
        here="an own plane sweep with slanted patches for every frame, of which only what several cameras agree on is kept",
        reason="COLMAP's PatchMatch needs CUDA",
        settings={"cloud": "frames"},
    ),
    Point(
        "density of the point clouds",
        "neither",
        released="one point per voxel of 0.012 scene units; a later frame adds points to empty voxels only",
        here="likewise, with voxels of some pixels; statistical outliers are removed; as many anchors as a setting allows "
        "at most",
        reason="0.012 means something else in every scene",
        settings={"max_static_points": 1_000_000, "max_moving_points": 1_000_000},
    ),
    Point(
        "deduplication",
        "paper",
        paper="outside of the union of spheres around all anchors of the reference clip, with the mean distance to three "
        "neighbours as radius",
        released="at least 0.005 scene units outside of the sphere around the nearest one, with the root mean square as "
        "radius; the points before training",
        here="the exact union; the anchors where training has put them",
        reason="the paper comes first; a nearest centre is not the union, and 0.005 means something else in every scene",
        settings={"residual": "dedup"},
    ),
    Point(
        "scales of residual anchors at their start",
        "neither",
        released="by mistake those of as many anchors of the reference clip",
        here="the distance to three neighbours, as for all others",
        reason="it is plainly a mistake: rows of the wrong cloud",
        settings={"initial": "published"},
    ),
)

_TRAINING = (
    Point(
        "positions of the anchors",
        "paper",
        paper="learned with the reference clip, frozen in source clips",
        released="fixed, but for one capture: 1.6e-4 to 1.6e-6 times the extent of the cameras",
        here="learned at the rates of that capture, those of residual anchors too",
        reason="the paper comes first",
        settings={"position_lr": 1.6e-4, "position_final_ratio": 0.01, "inherit": "frozen"},
    ),
    Point(
        "number of anchors", "released code", released="as the point clouds give them; none are added or removed later"
    ),
    Point("heads in source clips", "both", paper="frozen", settings={"decoder": "frozen"}),
    Point("field of a source clip", "both", paper="its own, from nothing", settings={"field": "per_clip"}),
    Point(
        "what a source clip depends on",
        "both",
        paper="the reference clip alone",
        settings={"independent": False, "start": "scratch"},
    ),
    Point(
        "length and order",
        "released code",
        released="34 passes over the pictures of a clip, every picture once a pass, one at a step",
        settings={"passes": 34},
    ),
    Point("what a step compares", "released code", released="whole pictures", settings={"tiles": "all"}),
    Point(
        "end of a pass",
        "neither",
        released="one picture more, drawn again",
        here="the next pass begins",
        reason="it seems not to be meant",
    ),
    Point(
        "weight of SSIM",
        "released code",
        paper="of no stated size",
        released="0.2",
        settings={"ssim_weight": 0.2},
    ),
    Point(
        "volume term",
        "paper",
        paper="the sum over the Gaussians, of no stated weight",
        released="0.01 times their mean",
        here="0.01 times the sum",
        reason="the paper comes first, with the only weight there is",
        settings={"volume": "sum", "volume_weight": 0.01},
    ),
    Point(
        "rates of features and scales",
        "released code",
        released="7.5e-3 and 7e-3, constant",
        settings={"feature_lr": 7.5e-3, "scale_lr": 7e-3, "feature_final_ratio": 1.0, "scale_final_ratio": 1.0},
    ),
    Point(
        "rates of the heads",
        "released code",
        released="opacity 2e-3 to 2e-5, shape 4e-3, colour and offset 8e-3 to 5e-5",
        settings={
            "opacity_head_lr": 2e-3,
            "shape_head_lr": 4e-3,
            "color_head_lr": 8e-3,
            "offset_head_lr": 8e-3,
            "opacity_head_final_ratio": 0.01,
            "shape_head_final_ratio": 1.0,
            "color_head_final_ratio": 0.00625,
            "offset_head_final_ratio": 0.00625,
        },
    ),
    Point(
        "rates of the field",
        "neither",
        released="2e-4 to 2e-6, in a reference clip times the extent of the cameras",
        here="2e-4 to 2e-6",
        reason="the factor is missing in source clips there, and the same scene in other units would learn otherwise",
        settings={"table_lr": 2e-4, "field_mlp_lr": 2e-4, "field_final_ratio": 0.01},
    ),
    Point(
        "where rates end",
        "paper",
        paper="a schedule as in 3D Gaussian splatting, begun anew with every clip",
        released="after 30,000 or 200,000 steps, so that a clip is done at three quarters of most rates",
        here="with the clip",
        reason="the paper comes first: there a schedule spans a training",
    ),
    Point(
        "Adam",
        "neither",
        paper="Adam",
        released="divides by 1e-15 at least, for the field by 1e-8",
        here="by 1e-15 for everything",
        reason="what is rarely seen has small gradients, and must not be slowed down by it",
    ),
    Point(
        "gradients",
        "neither",
        released="those of the field are cut at 1000, and what is not a number becomes zero",
        here="as they are; a training stops with a message where one is not finite",
        reason="cutting hides what went wrong",
        settings={"max_gradient_norm": 0.0},
    ),
)

_PICTURES = (
    Point(
        "what a camera decodes",
        "neither",
        released="anchors whose own ellipsoid lies in the picture",
        here="anchors that lie in the picture or within four of their sizes of it",
        reason="a Gaussian may lie beside its anchor, and is expected within that distance",
    ),
    Point(
        "rasterizer",
        "neither",
        paper="that of 3D Gaussian splatting",
        released="opacity of at most 0.99, Gaussians cut off at three standard deviations, a principal point in the middle, "
        "and a near plane at 0.2 scene units",
        here="0.999, cut off where the opacity falls below 1/255, the principal point of the camera, and a near plane at "
        "a fifth of the distance to what the cameras look at",
        reason="Gaussians end where they cannot be seen and not before; cameras and units are those of the capture",
    ),
)

POINTS: tuple[Point, ...] = (*_MODEL, *_CLOUDS, *_TRAINING, *_PICTURES)
"""Every point, in the order of the tables."""
