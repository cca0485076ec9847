"""The section on quality over the clips: losses by what, and exposures of the cameras."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from app.evaluation.headless import open_trained
from app.lab.report.over_clips import ClipExposure, exposures_of, over_clips_section
from app.project.opening.project_access import open_project
from engine.clip_files.clip_state import ClipState, read_clip_state, write_clip_state
from tests.app.lab.report.made_up import train
from tests.clip_headers import with_header


def evaluation_of(*clips: tuple[float, float, float | None], group: str = "held_out") -> dict:
    """Means of each clip: raw, after the colour fit, after light too."""
    names = ("psnr", "psnr_fit", "psnr_light")
    means = {str(i): {group: dict(zip(names, values, strict=True))} for i, values in enumerate(clips)}
    return {"means": {"clips": means, group: {"psnr": 1.0}}}


def exposure(clip_index: int, drift: np.ndarray | None = None, reference: int = 0) -> ClipExposure:
    return ClipExposure(reference, range(3 * clip_index, 3 * clip_index + 3), ("a", "b"), drift)


def rows_of(section, name: str) -> list[dict]:
    return next(table.rows for table in section.tables() if table.name == name)


def test_what_a_clip_loses_is_split_without_a_rest_that_nobody_accounts_for(quick_charts):
    evaluation = evaluation_of((30.0, 31.0, 32.0), (28.0, 30.5, 31.8), (29.0, 29.5, 30.0))
    drift = np.full((2, 3, 3), 1.02, np.float32)
    drift[1] = 1 / 1.02
    section = over_clips_section(evaluation, {0: exposure(0), 1: exposure(1, drift), 2: exposure(2)})
    first, second, third = rows_of(section, "over_clips")
    assert [first[name] for name in ("n_away", "lost_color", "lost_light", "lost_rest")] == [0, None, None, None]
    assert second["exposure_percent"] == pytest.approx(2.0, abs=1e-3), "cameras that go apart do not cancel"
    assert [second[name] for name in ("lost_color", "lost_light", "lost_rest")] == pytest.approx([1.5, 0.3, 0.2])
    assert [third[name] for name in ("lost_color", "lost_light", "lost_rest")] == pytest.approx([-0.5, -0.5, 2.0])
    for row in (second, third):
        assert row["lost_color"] + row["lost_light"] + row["lost_rest"] == pytest.approx(30.0 - row["psnr"])
    assert [row["n_away"] for row in (second, third)] == [1, 2]


def test_each_clip_is_set_beside_the_one_it_inherits_from(quick_charts):
    evaluation = evaluation_of((30.0, 31.0, 32.0), (29.0, 30.0, 31.0), (20.0, 21.0, 22.0), (19.0, 20.5, 21.5))
    exposures = {i: exposure(i, reference=2 * (i // 2)) for i in range(4)}
    rows = rows_of(over_clips_section(evaluation, exposures), "over_clips")
    assert [row["n_away"] for row in rows] == [0, 1, 0, 1]
    assert rows[3]["lost_rest"] == pytest.approx(0.5)
    assert rows[2]["lost_rest"] is None


def test_without_a_figure_there_is_no_loss(quick_charts):
    section = over_clips_section(
        evaluation_of((30.0, 31.0, 32.0), (29.0, 30.0, None)), {0: exposure(0), 1: exposure(1)}
    )
    row = rows_of(section, "over_clips")[1]
    assert (row["lost_color"], row["lost_light"], row["lost_rest"]) == (pytest.approx(0.0), None, None)


@pytest.mark.slow
def test_exposures_are_drawn_over_the_frames_of_all_clips():
    drift = np.ones((2, 3, 3), np.float32)
    drift[0, 1:] = 1.1
    exposures = {0: exposure(0), 1: exposure(1, drift)}
    evaluation = evaluation_of((30.0, 31.0, 32.0), (29.0, 30.0, 31.0), group="trained_on")
    section = over_clips_section(evaluation, exposures)
    rows = rows_of(section, "exposure")
    assert [row["frame_index"] for row in rows] == list(range(6))
    assert [row["camera_a"] for row in rows] == pytest.approx([0, 0, 0, 0, 10, 10], abs=1e-4)
    assert [row["camera_b"] for row in rows] == [0.0] * 6
    figures = {figure.name: figure for figure in section.figures()}
    assert figures.keys() == {"psnr_over_clips", "exposure"}
    for figure in figures.values():
        with Image.open(io.BytesIO(figure.png)) as picture:
            assert picture.width > 400
    calm = over_clips_section(evaluation, {0: exposure(0), 1: exposure(1)})
    assert calm.parts[-1] == "The clip files hold no change of any camera's exposure."


def test_exposures_come_from_the_clip_files(tmp_path, capture_folder):
    folder = train(tmp_path / "p", capture_folder)
    path = folder / "clips" / "0001.safetensors"
    state = with_header(read_clip_state(path), camera_names=["1", "2"])
    drift = np.full((2, 3, 3), 1.03, np.float32)
    write_clip_state(path, ClipState(state.arrays | {"log_drift": np.log(drift)}, state.header))
    project = open_project(folder, is_writable=False)
    found = exposures_of(open_trained(project), [0, 1])
    assert found[0].drift is None
    assert (found[1].reference_index, list(found[1].frames), found[1].camera_names) == (0, [3, 4, 5], ["1", "2"])
    assert found[1].drift == pytest.approx(drift)
