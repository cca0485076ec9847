"""The picture of spheres: which clip and camera, what is counted, and projects that have none of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.evaluation.headless import open_trained
from app.lab.pictures import RenderedPictures
from app.lab.report.paper_figures.spheres import chosen_camera
from app.playback.modes.coverage import CoveredSpace
from app.project.project_facts import read_facts
from engine.camera.rig import CameraRig
from engine.clip_files.clip_header import Coverage
from tests.app.lab.report.made_up import FakePictures, Page, change_header, report, train

NOTHING = "No trained clip inherits the anchors of the reference clip."


def space(points: np.ndarray, centers: np.ndarray | None = None) -> CoveredSpace:
    centers = np.zeros((0, 3)) if centers is None else centers
    return CoveredSpace(centers, np.ones(len(centers)), points, np.ones(len(points)), "key")


def page_of(project, **options) -> Page:
    return Page(report(project, **options).read_text(encoding="utf-8"))


def test_the_camera_is_the_one_that_shows_most_and_of_several_the_closest():
    behind, away = np.eye(4), np.eye(4)
    behind[2, 3], away[0, 3] = 5.0, 100.0
    K = np.array([[30.0, 0.0, 16.0], [0.0, 30.0, 12.0], [0.0, 0.0, 1.0]])
    rig = CameraRig(("a", "b", "c"), np.stack([away, behind, np.eye(4)]), np.stack([K] * 3), np.full((3, 2), 24))
    points = np.array([[0.0, 0.0, 3.0], [0.1, 0.0, 3.0]])
    assert chosen_camera(rig, [0, 1, 2], space(points)) == 2
    assert chosen_camera(rig, [0, 1], space(points)) == 1
    assert chosen_camera(rig, [0, 1, 2], space(points[:0], points)) == 2
    assert chosen_camera(rig, [1, 2], space(points[:0])) == 1


def test_the_clip_with_most_residual_anchors_is_shown_with_what_lies_in_and_outside(project):
    coverage = Coverage(n_points=90, n_inherited=70, n_residual=8, n_left_out=12, share=0.9, reason="")
    change_header(project / "clips/0001.safetensors", coverage=coverage)
    page = page_of(project)
    ((clip, camera, n_spheres, radius, n_outside, n_inside, _),) = page.tables["spheres"]
    assert (clip, n_spheres, radius) == ("1", "12", "0.1")
    assert camera != "0", "that one is held out"
    assert int(n_outside) + int(n_inside) == 8
    assert "Clip 1, the one with most residual anchors, over its first frame" in page.text
    assert "the training camera that shows most of them, and of several the closest" in page.text
    assert "Anchors travel here" in page.text


def test_places_are_chosen_by_hand_and_what_stays_says_what_is_covered(tmp_path, capture_folder, quick_charts):
    from app.lab.report.paper_figures.by_hand import FigureOptions

    project = train(tmp_path / "stay", capture_folder, motion="stay")
    coverage = Coverage(n_points=90, n_inherited=70, n_residual=8, n_left_out=12, share=0.9, reason="")
    change_header(project / "clips/0001.safetensors", coverage=coverage)
    page = page_of(project, wishes=FigureOptions(boundary=3, camera="2"))
    assert [row[:2] for row in page.tables["spheres"]] == [["1", "2"]]
    assert "Clip 1, chosen by hand" in page.text
    assert "camera 2, chosen by hand" in page.text
    assert "Of 90 points of the clip 70 lay inside" in page.text


@pytest.mark.parametrize(
    ("n_clips", "settings"),
    [(1, {}), (2, {"inherit": "off"}), (2, {"independent": True, "start": "previous"})],
)
def test_projects_without_spheres_say_so(tmp_path, capture_folder, quick_charts, n_clips, settings):
    page = page_of(train(tmp_path / "p", capture_folder, n_clips=n_clips, **settings))
    assert NOTHING in page.text
    assert "spheres" not in page.tables


def test_nothing_covered_and_nothing_residual_is_no_failure(project, monkeypatch):
    none = np.zeros((0, 3), np.float32)
    monkeypatch.setattr(FakePictures, "covered", lambda self, clip: space(none))
    ((_, _, n_spheres, radius, n_outside, n_inside, distance),) = page_of(project).tables["spheres"]
    assert [n_spheres, n_outside, n_inside] == ["0", "0", "0"]
    assert radius == distance == "–"


def test_a_point_that_rounding_has_put_into_a_sphere_is_outside_as_it_was(project, monkeypatch):
    on_it = replace(space(np.zeros((2, 3)), np.ones((4, 3))), distances=np.array([-1e-8, -0.1]))
    monkeypatch.setattr(FakePictures, "covered", lambda self, clip: on_it)
    ((*_, n_outside, n_inside, _),) = page_of(project).tables["spheres"]
    assert [n_outside, n_inside] == ["1", "1"]


def test_spheres_are_those_of_the_reference_clip_as_it_was_inherited(tmp_path, capture_folder):
    folder = train(tmp_path / "p", capture_folder)
    found = RenderedPictures(open_trained(read_facts(folder, "p").project)).covered(1)
    state = open_trained(read_facts(folder, "p").project).load(0).model.anchors()
    moving = state.own_positions if state.has_changing_static else state.own_positions[state.own_roles == 1]
    np.testing.assert_array_equal(found.centers, moving)
    assert len(found.points) == len(found.distances)
