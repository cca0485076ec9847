"""The section on residual anchors: spheres around inherited anchors, and what of a source clip lies outside of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.evaluation.headless import TrainedProject
from app.lab.report.page.parts import Figure, Section
from app.lab.report.page.tables import Table, TableColumn
from app.lab.report.paper_figures.by_hand import Places
from app.lab.report.paper_figures.drawing import draw_spheres
from app.lab.report.paper_figures.pictured import Pictured
from app.playback.modes.coverage import CoveredSpace
from app.project.project_facts import ClipFacts
from engine.camera.projection import is_in_picture, project, projection_matrices
from engine.camera.rig import CameraRig

_TITLE = "Spheres around inherited anchors"
_ON_A_SPHERE = 1e-4
"""Depth in a sphere, as a share of CoveredSpace.range, up to which a point was outside before places were rounded."""
_COLUMNS = (
    TableColumn("clip_index", "Clip"),
    TableColumn("camera", "Camera"),
    TableColumn("n_spheres", "Spheres"),
    TableColumn("radius", "Radius, median", unit="scene units"),
    TableColumn("n_outside", "Residual anchors outside"),
    TableColumn("n_inside", "Residual anchors inside"),
    TableColumn("distance", "Distance outside, median", unit="scene units"),
)


def spheres_section(own: Pictured, opened: TrainedProject, places: Places) -> Section:
    """One source clip of the page's own project, in a training camera."""
    facts, config = own.compared.facts, own.compared.facts.settings.config()
    sources = [clip for clip in facts.clips if clip.role == "source"]
    if not sources or config.inherit == "off" or config.start == "previous":
        return Section("spheres", _TITLE, ["No trained clip inherits the anchors of the reference clip."])
    clip, clip_rule = _chosen_clip(sources, places)
    space = own.pictures.covered(clip.clip_index)
    rig = opened.rig
    held_out = opened.capture.camera_indices(facts.settings.holdout)
    camera = chosen_camera(rig, [i for i in range(len(rig)) if i not in held_out], space)
    camera_rule = "the training camera that shows most of them, and of several the closest"
    if places.camera is not None:
        camera, camera_rule = rig.names.index(places.camera), "chosen by hand"
    truth, _ = own.pictures.pair(clip.clip_index, clip.start, rig.names[camera])
    (centers, depths), (points, point_depths) = (
        project(place, projection_matrices(rig)[camera]) for place in (space.centers, space.points)
    )
    radii = space.radii * rig.Ks[camera, 0, 0] / np.where(depths > 0, depths, np.inf)
    is_outside, is_shown = space.distances > -_ON_A_SPHERE * space.range, point_depths > 0
    n_outside, n_inside = int(is_outside.sum()), int((~is_outside).sum())
    which = "all anchors" if config.gate == "off" else "the moving anchors"
    caption = (
        f"Clip {clip.clip_index}, {clip_rule}, over its first frame; camera {rig.names[camera]}, {camera_rule}. Blue: "
        f"{which} of the reference clip, {len(space.centers):,}, each with its sphere, whose radius is the mean "
        f"distance to three neighbours. Orange: {n_outside:,} residual anchors outside of all spheres. Green: "
        f"{n_inside:,} inside. A dot within a circle may lie in front of that sphere or behind it. On the right the "
        "part with most of the orange dots."
    )
    if config.anchors_travel:
        caption += " Anchors travel here, so points inside become anchors as well; all are where their motion begins."
    elif clip.coverage is not None:
        caption += (
            f" Of {clip.coverage.n_points:,} points of the clip {clip.coverage.n_inherited:,} lay inside, where "
            "inherited anchors serve; their places are not kept."
        )
    figure = Figure(
        "spheres",
        draw_spheres(
            truth,
            centers[depths > 0],
            radii[depths > 0],
            outside=points[is_outside & is_shown],
            inside=points[~is_outside & is_shown],
        ),
        caption,
        f"The picture, and a part of it enlarged, with dots and circles. {caption}",
    )
    row = {
        "clip_index": clip.clip_index,
        "camera": rig.names[camera],
        "n_spheres": len(space.centers),
        "radius": _median(space.radii),
        "n_outside": n_outside,
        "n_inside": n_inside,
        "distance": _median(space.distances[is_outside]),
    }
    return Section("spheres", _TITLE, [figure, Table("spheres", "Counts of the picture above", _COLUMNS, [row])])


def _chosen_clip(sources: Sequence[ClipFacts], places: Places) -> tuple[ClipFacts, str]:
    """The source clip that begins at the chosen boundary, else the one with most residual anchors; and the rule."""
    for clip in sources:
        if clip.start == places.boundary:
            return clip, "chosen by hand"
    most = max(sources, key=lambda clip: clip.coverage.n_residual if clip.coverage else 0)
    return most, "the one with most residual anchors"


def chosen_camera(rig: CameraRig, cameras: Sequence[int], space: CoveredSpace) -> int:
    """The camera in whose picture most residual anchors lie, of several the closest; most spheres where there are no
    residual anchors."""
    places = space.points if len(space.points) else space.centers
    matrices = projection_matrices(rig)

    def shown(camera: int) -> tuple[int, float]:
        pixels, depths = project(places, matrices[camera])
        width, height = (int(size) for size in rig.image_sizes[camera])
        is_seen = is_in_picture(pixels, depths, width, height)
        return int(is_seen.sum()), -float(np.median(depths[is_seen])) if is_seen.any() else 0.0

    return max(cameras, key=shown)


def _median(values: np.ndarray) -> float | None:
    """Of finite values, None where there are none: without spheres everything is infinitely far."""
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else None
