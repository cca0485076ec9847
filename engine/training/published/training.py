"""Points about the training: learning parameters, steps, rates, and losses."""

from __future__ import annotations

from engine.training.published.point import Point

TRAINING = (
    Point(
        "positions of the anchors",
        "paper",
        paper="learned with the reference clip, frozen in source clips",
        released="fixed, but for one capture: 1.6e-4 to 1.6e-6, in a reference clip times the extent of the cameras; "
        "the field gives them no gradient",
        here="learned at the rates of that capture times the extent, those of residual anchors too; likewise without a "
        "gradient through the field",
        reason="the paper comes first",
        settings={"position_lr": 1.6e-4, "position_final_ratio": 0.01, "inherit": "frozen"},
    ),
    Point(
        "anchors over time",
        "both",
        paper="each at its position, at every time",
        settings={"motion": "stay"},
    ),
    Point(
        "number of anchors",
        "released code",
        released="as the point clouds give them; none are removed later, and adding some is switched off for its own "
        "captures",
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
        released="34 passes over the pictures of a clip for its Long 360 capture, every picture once a pass, one at a "
        "step",
        settings={"passes": 34},
    ),
    Point(
        "what a step compares",
        "neither",
        released="whole pictures",
        here="whole pictures up to about 640 x 480; one window of a larger picture, so that a pass over pictures of "
        "1920 x 1080 has eight times as many steps",
        reason="a step takes as long at any size",
        settings={"tiles": "all"},
    ),
    Point(
        "end of a pass",
        "neither",
        released="a step more, with the last picture again",
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
        here="0.01 times the sum, in cubes of scene units",
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
        released="after 30,000 steps, or 200,000 for its own captures, where a clip of 10,880 ends at three quarters "
        "of most rates",
        here="with the clip",
        reason="the paper comes first: there a schedule spans a training",
        settings={"schedule": "per_clip"},
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
