"""Points about the model: anchors, field, heads, and how pictures are drawn of them."""

from __future__ import annotations

from engine.training.published.point import Point

MODEL = (
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
        released="16 levels of 4 values, from 16 cells on and twice as many at every level; 128 values in the "
        "network's hidden layer, no biases; 2^17 entries a level by default (`paper`), 2^20 for Long 360 "
        "(`paper-long360`; 2^17 in its parallel scripts), 2^19 for VRU (`paper-vru`), 2^16 or 2^17 for N3DV",
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
        released="features of zero, all scales the root mean square distance to three neighbours, entries of the "
        "grid within 1e-4, heads as PyTorch starts any layer; nothing of the colours of the point cloud",
        settings={"initial": "published"},
    ),
    Point(
        "which anchors change over time",
        "both",
        paper="all of them, at every time",
        settings={"gate": "off"},
    ),
    Point(
        "colours of the cameras",
        "released code",
        released="those of the scene, for all of them",
        settings={"color": "off"},
    ),
    Point("stored values", "released code", released="float32, as trained", settings={"storage": "exact"}),
    Point(
        "knots in time",
        "neither",
        paper="a 4D hash grid",
        released="time has as many cells as each axis of space, and 16 corners are interpolated; as there are more "
        "cells than frames, each frame lies in one of its own, between two knots",
        here="time has a knot on every frame, and the 8 corners in space are interpolated there",
        reason="half the entries to read, and what lies between two frames is defined instead of left to chance",
        settings={"field_tables": "shared"},
    ),
    Point(
        "cells of a level",
        "neither",
        released="16 times 2^l less one, shifted by half a cell; a level without hashing if its knots in space and "
        "time fit the table",
        here="16 times 2^l, not shifted; likewise with the frames of the clip as knots in time; a level that fits the "
        "table in space alone is hashed in time alone",
        reason="how tiny-cuda-nn lays out its grid is its own choice, and the grid here is another one",
        settings={"field_base_cells": 16, "field_growth": 2.0},
    ),
    Point(
        "numbers in the field",
        "neither",
        paper="a fully fused MLP",
        released="tiny-cuda-nn: half precision, weights that start as Xavier's",
        here="float32; weights start likewise",
        settings={"initial": "published"},
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
        released="a mask network, and offsets, opacities, rotations and a time embedding beside the anchors: "
        "stored, and used by nothing that is shown",
        here="not there",
        reason="they change no picture",
    ),
    Point(
        "what a camera decodes",
        "neither",
        released="anchors whose own ellipsoid lies in the picture",
        here="anchors that lie in the picture or within four of their sizes of it, as they are at the start of a "
        "training",
        reason="a Gaussian may lie beside its anchor, and is expected within that distance; an interrupted "
        "training sees the same anchors again",
    ),
    Point(
        "rasterizer",
        "neither",
        paper="that of 3D Gaussian splatting",
        released="opacity of at most 0.99, Gaussians cut off at three standard deviations, a principal point in the "
        "middle, and a near plane at 0.2 scene units",
        here="0.999, cut off where what they add falls below 1/255, the principal point of the camera, and a near "
        "plane at a fifth of the distance to what the cameras look at",
        reason="no light is ever used up altogether; Gaussians end where they cannot be seen; cameras and units are "
        "those of the capture",
    ),
)
