"""Running an ablation: what is trained and measured, what is taken up, going on where it stopped."""

from __future__ import annotations

import csv
import json
import shutil
from dataclasses import replace

import pytest

from app.evaluation.headless import TrainedProject
from app.evaluation.speed.frame_rates import FrameRates
from app.evaluation.speed.laps import RenderRate
from app.lab.ablation.measuring import MEASURED_FILE
from app.lab.ablation.running import RESULT_FILE, TABLE_FILE, project_folder
from app.lab.ablation.table import as_text
from app.lab.ablation.variants import FULL, with_source_steps
from app.project.opening.project_access import open_project, read_settings
from engine.errors import ProjectError, TrainingError
from tests.app.fakes import make_fake
from tests.app.lab.ablation.runs import BASE, BY_NAME


@pytest.mark.slow
def test_every_variant_is_a_project_and_a_line_of_the_table(runner):
    document = runner.run(list(BY_NAME))
    assert [line["variant"] for line in document["lines"]] == list(BY_NAME)
    assert json.loads((runner.folder / RESULT_FILE).read_text()) == document
    assert [row["variant"] for row in csv.DictReader((runner.folder / TABLE_FILE).read_text().splitlines())] == list(
        BY_NAME
    )
    for name, variant in BY_NAME.items():
        settings = read_settings(project_folder(runner.folder, name, 0))
        n_clips = {"clips": 2, "shorter": 3, "longer": 1, "whole": 1, "frames": 6, "first": 1}[variant.cut]
        trained = sorted((project_folder(runner.folder, name, 0) / "clips").iterdir())
        assert len(trained) == n_clips, name
        assert settings.overrides | variant.overrides == settings.overrides
    line = document["lines"][0]
    assert line["psnr"] == 22.0
    n_frames = {line["variant"]: line["n_frames"] for line in document["lines"]}
    assert n_frames == {name: 1 if name == "first-frame" else 6 for name in BY_NAME}
    assert [result["n_frames"] for result in document["results"]] == list(n_frames.values())
    for line in document["lines"]:  # whatever its own clips are: those of full begin at frame 4
        assert line["seam_ratio_static"] == pytest.approx(2.0)
        assert line["flicker_inside"] == pytest.approx(255 * 0.02)
        assert line["flicker_borders"] == pytest.approx(255 * 0.04)
    assert line["minutes"] > 0
    assert line["megabytes"] > 0
    assert line["mb_per_frame"] == pytest.approx(line["megabytes"] / line["n_frames"])


def test_the_reference_clip_of_full_is_not_trained_again(runner):
    runner.run(["decoder-new", "independent"])
    assert ("full-seed0", 0) in runner.launched
    assert ("decoder-new-seed0", 0) not in runner.launched
    assert ("decoder-new-seed0", 1) in runner.launched
    assert ("independent-seed0", 0) not in runner.launched
    assert ("independent-seed0", 1) in runner.launched
    full, other = (project_folder(runner.folder, name, 0) / "clips/0000.safetensors" for name in (FULL, "decoder-new"))
    assert full.read_bytes() == other.read_bytes()


def test_clips_on_their_own_of_another_length_begin_with_the_first_clip_of_those_that_inherit(runner):
    runner.run(["independent-shorter"], settings=replace(runner.settings, clip_length=2))
    trained = {name: [clip for of, clip in runner.launched if of == name] for name, _ in runner.launched}
    assert trained["clips-shorter-seed0"][0] == 0
    assert trained["independent-shorter-seed0"] == trained["clips-shorter-seed0"][1:]


def test_source_clips_of_several_lengths_share_the_reference_clip_of_their_family(runner):
    variants = [with_source_steps(BY_NAME[name], n) for name in (FULL, "published", "decoder-new") for n in (4, 8)]
    document = runner.run(variants=variants)
    trained_first = {name for name, clip in runner.launched if clip == 0}
    assert trained_first == {"full-steps4-seed0", "published-steps4-seed0"}
    lines = {line["variant"]: line for line in document["lines"]}
    assert list(lines) == [f"{name}-steps{n}" for name in (FULL, "decoder-new", "published") for n in (4, 8)]
    assert lines["published-steps8"]["later_psnr"] == pytest.approx(20.8)
    assert lines["published-steps8"]["later_s"] > 0
    curves = {curve["variant"]: curve for curve in document["curves"]}
    assert list(curves) == [FULL, "decoder-new", "published"]
    assert [point["source_steps"] for point in curves["published"]["points"]] == [4, 8]
    assert curves["published"]["at_equal"]["later_psnr"]["psnr"] == pytest.approx(20.8)
    assert curves["published"]["at_equal"]["later_psnr_moving"] is None
    launched = len(runner.launched)
    assert runner.run([FULL])["curves"] == document["curves"]  # lines of earlier calls stay
    assert {name for name, _ in runner.launched[launched:]} == {"full-seed0"}


def test_each_seed_has_projects_of_its_own(runner):
    document = runner.run(["residual-none"], seeds=[0, 3])
    assert [(r["variant"], r["seed"]) for r in document["results"]] == [
        (FULL, 0), (FULL, 3), ("residual-none", 0), ("residual-none", 3)]  # fmt: skip
    assert read_settings(project_folder(runner.folder, FULL, 3)).seed == 3
    assert document["lines"][0]["n_seeds"] == 2


def test_what_is_done_is_not_done_again(runner):
    first = runner.run(["decoder-new"])
    launched, measured = list(runner.launched), list(runner.measured)
    assert runner.run(["decoder-new"]) == first
    assert (runner.launched, runner.measured) == (launched, measured)
    runner.run(["decoder-new", "residual-none"])
    assert {name for name, _ in runner.launched[len(launched) :]} == {"residual-none-seed0"}
    assert runner.measured[len(measured) :] == ["residual-none-seed0"]


def test_a_later_call_keeps_the_lines_of_earlier_ones_in_order(runner):
    runner.run(["residual-none"], seeds=[1])
    runner.run(["independent"])
    launched = len(runner.launched)
    document = runner.run(["decoder-new"])
    assert [line["variant"] for line in document["lines"]] == [FULL, "decoder-new", "residual-none", "independent"]
    assert list(document["words"]) == [line["variant"] for line in document["lines"]]
    assert [(r["variant"], r["seed"]) for r in document["results"]] == [
        (FULL, 0), (FULL, 1), ("decoder-new", 0), ("residual-none", 1), ("independent", 0)]  # fmt: skip
    assert document["seeds"] == [0, 1]
    assert json.loads((runner.folder / RESULT_FILE).read_text()) == document
    written = csv.DictReader((runner.folder / TABLE_FILE).read_text().splitlines())
    assert [row["n_seeds"] for row in written] == ["2", "1", "1", "1"]
    assert {name for name, _ in runner.launched[launched:]} == {"decoder-new-seed0"}


def test_only_what_fits_the_settings_is_taken_up(runner):
    runner.run(["residual-none", "independent"])
    place = project_folder(runner.folder, "residual-none", 0)
    text = json.loads((place / MEASURED_FILE).read_text())
    text["key"]["clips"][1] = "of other clips"
    (place / MEASURED_FILE).write_text(json.dumps(text))
    assert [line["variant"] for line in runner.run([FULL])["lines"]] == [FULL, "independent"]
    assert [line["variant"] for line in runner.run([FULL], n_clips=1)["lines"]] == [FULL]
    shutil.copytree(project_folder(runner.folder, "independent", 0), project_folder(runner.folder, "independent", 7))
    (runner.folder / "full-seedx").mkdir()
    document = runner.run([FULL])  # a copy under another seed has settings of its own
    assert [(r["variant"], r["seed"]) for r in document["results"]] == [(FULL, 0), ("independent", 0)]


def test_a_figure_file_that_is_damaged_or_of_other_clips_is_measured_again(runner):
    runner.run([FULL])
    path = project_folder(runner.folder, FULL, 0) / MEASURED_FILE
    path.write_text("{")
    runner.run([FULL])
    runner.run([FULL], n_clips=1)
    runner.run([FULL], n_clips=1, precision="8bit")
    assert runner.measured == ["full-seed0"] * 4


def test_it_goes_on_where_it_was_stopped(runner):
    def fails_in_clip_1(job, store, report):
        training = make_fake(job, store, report)
        training.fails_at = 2 if job.clip_index == 1 and "decoder" in job.overrides else None
        return training

    runner.make_training = fails_in_clip_1
    with pytest.raises(TrainingError, match=r"decoder-new, seed 0: The loss became nan") as caught:
        runner.run(["decoder-new"])
    assert caught.value.hint
    assert [line["variant"] for line in json.loads((runner.folder / RESULT_FILE).read_text())["lines"]] == [FULL]
    open_project(project_folder(runner.folder, "decoder-new", 0)).close()  # the lock was given back
    runner.make_training = make_fake
    launched = len(runner.launched)
    document = runner.run(["decoder-new"])
    assert runner.launched[launched:] == [("decoder-new-seed0", 1)]
    assert len(document["lines"]) == 2


def test_other_settings_in_the_same_folder_are_refused(runner):
    runner.run([FULL])
    with pytest.raises(ProjectError, match="other settings") as caught:
        runner.run([FULL], settings=replace(runner.settings, overrides=BASE | {"joint_steps": 7}))
    assert "--project" in caught.value.hint
    open_project(project_folder(runner.folder, FULL, 0)).close()


@pytest.mark.parametrize(
    ("overrides", "names", "expected"),
    [
        ({"field": "continue"}, ["independent"], "cannot continue each other's field"),
        ({"decoder": "new"}, ["independent"], "decoder=new would have no effect"),
        ({"residual": "none"}, ["inherit-off"], "with nothing that moves"),
        ({"field": "joint"}, None, "field=joint leaves no clips"),
    ],
)
def test_settings_that_a_variant_cannot_have_are_said_before_anything_is_trained(runner, overrides, names, expected):
    with pytest.raises(ProjectError, match=expected):
        runner.run(names, settings=replace(runner.settings, overrides=BASE | overrides))
    assert not runner.launched
    assert not runner.folder.exists()


def test_frame_rates_are_columns_and_change_no_kept_figure(runner):
    def rates_of(opened: TrainedProject) -> FrameRates:
        fps = 10.0 + len(opened.project.folder.name)
        return FrameRates("0", 32, 24, RenderRate(fps, 30.0, 500, 3, "CPU rasterizer, 2 threads"), None, "no driver")

    without = runner.run([FULL])
    kept = project_folder(runner.folder, FULL, 0) / MEASURED_FILE
    before = kept.read_bytes()
    document = runner.run([FULL], rates_of=rates_of)
    assert kept.read_bytes() == before
    (line,) = document["lines"]
    assert (line["fps_cpu"], line["fps_gl"], line["n_gaussians"]) == (10.0 + len("full-seed0"), None, 500.0)
    assert without["lines"] == [line | {"fps_cpu": None, "n_gaussians": None}]
    assert without["rendering"] is None
    rendering = document["rendering"]
    assert (rendering["width"], rendering["height"]) == (32, 24)
    for part in ("32 x 24 px", "CPU rasterizer, 2 threads", "No OpenGL: no driver."):
        assert part in rendering["words"]
    assert "FPS CPU" in as_text(document["lines"])
    assert "FPS GL" not in as_text(document["lines"])
