"""Ablations: what variants there are, how their settings follow from "full", the table, going on, the command line."""

from __future__ import annotations

import csv
import io
import json
import math
import shutil
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.ablation import measuring
from app.ablation.measuring import MEASURED_FILE
from app.ablation.running import RESULT_FILE, TABLE_FILE, Callbacks, project_folder, run_ablation
from app.ablation.table import COLUMNS, VariantResult, as_csv, as_text, summarize
from app.ablation.variants import FULL, MIN_STEPS_PER_FRAME, VARIANTS, chosen_variants, settings_of
from app.cli import main
from app.headless import open_trained
from app.project import Project, ProjectSettings, create_project, default_settings, open_project, read_settings
from app.training.messages import TrainJob
from engine.capture.capture import Capture, open_capture
from engine.capture.clip import split_clips
from engine.errors import ProjectError, TrainingError
from engine.metrics.seams import PairRow
from engine.model.clip_state import read_clip_state
from engine.training.config import TrainConfig
from engine.training.presets import PRESETS, preset
from tests.app.conftest import inline
from tests.app.fakes import make_fake

BASE: dict[str, Any] = {"joint_steps": 6, "source_steps": 4}
BY_NAME = {variant.name: variant for variant in VARIANTS}


# ---------------------------------------------------------------- variants and their settings


def test_variants_are_named_once_and_their_settings_are_valid():
    assert len(BY_NAME) == len(VARIANTS)
    assert VARIANTS[0].name == FULL
    assert not VARIANTS[0].overrides
    for variant in VARIANTS:
        assert TrainConfig(**variant.overrides).difference() == variant.overrides  # none repeats a default
        assert variant.words
    listed = {"decoder": "new", "residual": "none", "inherit": "off", "field": "continue", "independent": True}
    for name, value in listed.items():
        assert any(variant.overrides.get(name) == value for variant in VARIANTS)


def test_only_variants_whose_reference_clip_is_trained_alike_share_it():
    for variant in VARIANTS:
        is_source_only = variant.cut == "clips" and not variant.is_reference_moved and variant.overrides.keys() <= {
            "decoder", "residual", "inherit", "field"}  # fmt: skip
        assert variant.shares_reference == is_source_only, variant.name


def test_variants_are_chosen_by_name_in_the_order_of_the_table_with_full_beside_them():
    assert [v.name for v in chosen_variants(["independent", "decoder-new"])] == [FULL, "decoder-new", "independent"]
    assert chosen_variants(None) == list(VARIANTS)
    assert [v.name for v in chosen_variants([FULL])] == [FULL]
    with pytest.raises(ProjectError, match="called nonsense") as caught:
        chosen_variants(["full", "nonsense"])
    assert "decoder-new" in caught.value.hint


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda variant: variant.name)
def test_a_variant_changes_what_it_names_and_trains_as_long_as_full(variant):
    clips = split_clips(10, 4)  # the last one has two frames
    overrides, clip_length, chosen = settings_of(variant, {}, clips=clips, n_cameras=100, n_capture_frames=10)
    config, full = TrainConfig(**overrides), TrainConfig()
    joint, source = full.n_joint_steps(400), [full.n_source_steps(400), full.n_source_steps(200)]
    n_steps = joint + sum(source)
    assert overrides | variant.overrides == overrides
    changed = overrides.keys() - variant.overrides.keys()
    n_frames_covered = sum(clip.n_frames for clip in split_clips(10, clip_length)[chosen.start : chosen.stop])
    match variant.cut:
        case "clips":
            assert (changed, clip_length, chosen) == (set(), 4, range(3))
        case "whole":
            assert (changed, clip_length, chosen) == ({"joint_steps"}, 10, range(1))
            assert config.n_joint_steps(1000) == n_steps
        case "frames":
            assert (changed, clip_length, chosen) == ({"joint_steps", "source_steps"}, 1, range(10))
            assert config.n_joint_steps(100) == joint
            assert n_steps - 9 < config.n_joint_steps(100) + 9 * config.n_source_steps(100) <= n_steps
        case "shorter" | "longer":
            length = {"shorter": 2, "longer": 8}[variant.cut]
            assert (changed, clip_length, chosen) == ({"joint_steps", "source_steps"}, length, range(-(-10 // length)))
            assert config.joint_steps == joint * length / 4
            assert config.source_steps == source[0] * length / 4
        case "first":
            assert (changed, clip_length, chosen) == ({"joint_steps"}, 1, range(1))
            assert config.n_joint_steps(100) == joint
    assert n_frames_covered == (1 if variant.cut == "first" else 10)


def test_settings_of_full_stay_in_every_variant_and_a_frame_has_its_least_steps():
    clips = split_clips(8, 4)
    for variant in VARIANTS:
        assert settings_of(variant, {"passes": 2.0}, clips=clips, n_cameras=3, n_capture_frames=8)[0]["passes"] == 2.0
    overrides, _, _ = settings_of(
        BY_NAME["frame-stream"], {"passes": 2.0}, clips=clips, n_cameras=3, n_capture_frames=8
    )
    assert overrides["joint_steps"] == 24  # two passes over three cameras and four frames, for the first frame alone
    assert overrides["source_steps"] == MIN_STEPS_PER_FRAME
    alone, _, _ = settings_of(BY_NAME["frame-stream"], {}, clips=split_clips(1, 1), n_cameras=3, n_capture_frames=1)
    assert alone["source_steps"] >= MIN_STEPS_PER_FRAME


@pytest.mark.parametrize(("n_frames", "length", "n_capture_frames", "shorter", "longer"), [
    (40, 10, 150, 5, 20), (30, 10, 150, 5, 30), (30, 10, 30, 5, 20), (28, 7, 150, 2, 14), (3, 1, 3, 1, 2),
])  # fmt: skip
def test_other_clip_lengths_cover_the_same_frames(n_frames, length, n_capture_frames, shorter, longer):
    clips = split_clips(n_frames, length)
    for cut, expected in (("shorter", shorter), ("longer", longer)):
        variant = BY_NAME[f"clips-{cut}"]
        _, got, chosen = settings_of(variant, {}, clips=clips, n_cameras=3, n_capture_frames=n_capture_frames)
        assert got == expected
        assert split_clips(n_capture_frames, got)[chosen[-1]].stop == n_frames


def test_the_reference_in_the_middle_is_trained_first(runner):
    runner.run(["reference-middle"])
    assert [clip for name, clip in runner.launched if name == "reference-middle-seed0"] == [1, 0]


# ---------------------------------------------------------------- the table


def pair(frame: int, static: float) -> dict[str, Any]:
    return PairRow(frame, 0, "0", True, False, static, None, 0.0, None, static, None, 1.0).as_dict()


RESULTS = [
    VariantResult("full", 0, {"psnr": 20.0, "ssim": 0.9, "lpips": None}),
    VariantResult("other", 0, {"psnr": math.inf, "ssim": 0.5}),
    VariantResult("full", 1, {"psnr": 24.0, "ssim": None}),
]


def test_seeds_become_mean_and_spread():
    full, other = summarize(RESULTS)
    assert [line["variant"] for line in (full, other)] == ["full", "other"]
    assert (full["n_seeds"], other["n_seeds"]) == (2, 1)
    assert full["psnr"] == 22.0
    assert full["psnr_std"] == pytest.approx(math.sqrt(8.0))  # of a sample: (2^2 + 2^2) / (2 - 1)
    assert (full["ssim"], full["ssim_std"]) == (0.9, None)  # of the one seed that has it
    assert other["psnr"] is None  # not finite
    assert full.keys() == {"variant", "n_seeds", "n_frames", *COLUMNS, *(f"{name}_std" for name in COLUMNS)}
    assert summarize([]) == []


def test_the_text_has_a_line_per_variant_and_no_empty_columns():
    lines = as_text(summarize(RESULTS)).splitlines()
    assert lines[0].split() == ["PSNR", "SSIM"]
    assert lines[1].split() == ["full", "22.00", "±2.83", "0.9000"]
    assert lines[2].split() == ["other", "-", "0.5000"]
    assert len({len(line) for line in lines}) == 1
    assert as_text([]).strip() == ""


def test_a_line_says_on_how_many_frames_it_was_measured():
    lines = summarize([VariantResult("full", 0, {"psnr": 20.0}, 6), VariantResult("first-frame", 0, {"psnr": 30.0}, 1)])
    assert [line["n_frames"] for line in lines] == [6, 1]
    text = [line.split() for line in as_text(lines).splitlines()]
    assert text == [["frames", "PSNR"], ["full", "6", "20.00"], ["first-frame", "1", "30.00"]]
    assert [row["n_frames"] for row in csv.DictReader(io.StringIO(as_csv(lines)))] == ["6", "1"]


def test_the_file_has_full_precision():
    rows = list(csv.DictReader(io.StringIO(as_csv(summarize(RESULTS)))))
    assert [row["variant"] for row in rows] == ["full", "other"]
    assert float(rows[0]["psnr_std"]) == math.sqrt(8.0)
    assert rows[1]["psnr"] == ""


# ---------------------------------------------------------------- running


class Runner:
    """Runs ablations on the tiny capture with the fake training; measuring is counted, not done."""

    def __init__(self, folder: Path, capture: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self.capture = folder, capture
        self.settings = default_settings(capture, clip_length=4, overrides=BASE)
        self.launched: list[tuple[str, int]] = []
        self.measured: list[str] = []
        self.outcomes: list[str] = []
        self.make_training = make_fake
        monkeypatch.setattr(measuring, "evaluate_project", self._evaluate)
        monkeypatch.setattr("app.headless.POLL_EVERY_S", 0.0)

    def _evaluate(self, opened, *, clip_indices, cameras, metrics, precision, on_progress) -> dict[str, Any]:
        self.measured.append(opened.project.folder.name)
        assert list(cameras) == [0]
        means = {"psnr": 20.0 + len(clip_indices), "ssim": 0.5, "curves": {"not": "a figure"}}
        rows = [pair(frame, 0.04 if frame == 4 else 0.02) for frame in range(1, 6)]
        return {"means": {"held_out": means, "trained_on": {}}, "seams": {"rows": rows}}

    def _launch(self, job, project):
        self.launched.append((project.folder.name, job.clip_index))
        return inline(job, project, make_training=self.make_training)

    def run(self, names: list[str] | None = None, **changes: Any) -> dict[str, Any]:
        arguments: dict[str, Any] = {"variants": chosen_variants(names), "n_clips": 2, "seeds": [0]}
        nothing = lambda *_: None  # noqa: E731
        return run_ablation(
            self.folder,
            self.capture,
            changes.pop("settings", self.settings),
            metrics="quick",
            launch=self._launch,
            callbacks=Callbacks(
                nothing, nothing, nothing, lambda outcome: self.outcomes.append(outcome.state), nothing
            ),
            **(arguments | changes),
        )


@pytest.fixture
def runner(tmp_path, capture_folder, monkeypatch) -> Runner:
    return Runner(tmp_path / "a", open_capture(capture_folder), monkeypatch)


def test_every_variant_is_a_project_and_a_line_of_the_table(runner):
    document = runner.run()
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


def test_the_reference_clip_of_full_is_not_trained_again(runner):
    runner.run(["decoder-new", "independent"])
    assert ("full-seed0", 0) in runner.launched
    assert ("decoder-new-seed0", 0) not in runner.launched
    assert ("decoder-new-seed0", 1) in runner.launched
    assert ("independent-seed0", 0) in runner.launched
    full, other = (project_folder(runner.folder, name, 0) / "clips/0000.safetensors" for name in (FULL, "decoder-new"))
    assert full.read_bytes() == other.read_bytes()


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
    def fails_in_clip_1(job, report):
        training = make_fake(job, report)
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
        ({"decoder": "new"}, ["independent"], "decoder=new would change nothing"),
        ({"residual": "none"}, ["inherit-off"], "without anything that moves"),
        ({"field": "joint"}, None, "field=joint leaves no clips"),
    ],
)
def test_settings_that_a_variant_cannot_have_are_said_before_anything_is_trained(runner, overrides, names, expected):
    with pytest.raises(ProjectError, match=expected):
        runner.run(names, settings=replace(runner.settings, overrides=BASE | overrides))
    assert not runner.launched
    assert not runner.folder.exists()


# ---------------------------------------------------------------- projects


def test_clips_are_trained_from_the_reference_on(tmp_path):
    settings = ProjectSettings(capture="c", fingerprint="f", reference_clip=2, clip_length=2)
    project = create_project(tmp_path / "p", settings)
    assert project.training_order(4) == [2, 0, 1, 3]
    assert (project.inherited_index(0), project.inherited_index(2), project.base_index(1)) == (2, None, 2)
    project.update(replace(settings, overrides={"independent": True}))
    assert (project.inherited_index(0), project.base_index(1)) == (None, 1)
    project.update(replace(settings, overrides={"field": "joint"}))
    assert [clip.n_frames for clip in project.clips(7)] == [7]
    project.close()


def test_a_reference_clip_that_is_none_is_refused(capture_folder):
    capture = open_capture(capture_folder)
    assert default_settings(capture, clip_length=3, reference_clip=1).reference_clip == 1
    for reference_clip, overrides in ((2, {}), (-1, {}), (1, {"field": "joint"})):
        with pytest.raises(ProjectError, match=f"reference clip is {reference_clip}"):
            default_settings(capture, clip_length=3, reference_clip=reference_clip, overrides=overrides)


@pytest.fixture
def continued(tmp_path) -> Iterator[tuple[Project, TrainJob]]:
    """A real project of the sample whose one field goes on: reference clip 1, then clip 0; and a job of it."""
    from engine.model.clip_state import ClipState, write_clip_state
    from tests.engine.training.tiny_training import SIZES, make_tiny

    tiny = make_tiny(tmp_path / "prep")
    reference = ClipState(tiny.reference.arrays, tiny.reference.header | {"clip_index": 1, "start": 4})
    settings = default_settings(
        tiny.capture,
        clip_length=4,
        holdout=tuple(tiny.capture.rig.names[camera] for camera in tiny.holdout),
        overrides=SIZES | {"field": "continue"},
        reference_clip=1,
    )
    project = create_project(tmp_path / "p", settings)
    project.prep_dir.mkdir()
    for path in tiny.prep_dir.iterdir():
        shutil.copy(path, project.prep_dir)
    first = tiny.trained(0, reference=reference, previous=reference, field="continue")
    for i, state in ((0, first), (1, reference)):
        write_clip_state(project.clip_path(i), state)
    job = TrainJob(str(project.folder), settings.capture, settings.scale, 4, 2, tuple(tiny.holdout))
    yield project, replace(job, overrides=settings.overrides)
    project.close()


def test_one_field_goes_on_in_training_order_and_shows_every_clip_as_it_ends(continued, monkeypatch):
    from app.training import build
    from engine.training.clip_training import ClipTraining

    monkeypatch.setattr(build, "warm_up_reporting", lambda report: None)
    project, job = continued
    opened = open_trained(project)
    fields = []
    for i in (0, 1):
        field = opened.load(i).model.field
        assert field is not None
        assert not any(parameter.requires_grad for parameter in field.parameters())
        fields.append(field.hidden.weight.numpy())
    last = read_clip_state(project.clip_path(0)).arrays["field.hidden.weight"]
    assert np.array_equal(fields[0], last)
    assert np.array_equal(fields[1], last)  # not clip 1's own, though its number is higher
    training = build.build_training(job, lambda _: None)
    assert isinstance(training, ClipTraining)
    assert training.previous is not None
    assert training.previous.header["clip_index"] == 0
    assert training.reference is not None
    assert training.reference.header["clip_index"] == 1
    with pytest.raises(ProjectError, match="goes on where clip 2 ends, which is not trained"):
        build.build_training(replace(job, clip_index=3), lambda _: None)
    alone = build.build_training(replace(job, clip_index=1), lambda _: None)
    assert isinstance(alone, ClipTraining)
    assert (alone.reference, alone.previous) == (None, None)


# ---------------------------------------------------------------- the command line


@pytest.fixture
def run(capsys):
    def run_command(*arguments: object) -> tuple[int, str, str]:
        code = main([str(part) for part in arguments], launch=partial(inline, make_training=make_fake))
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run_command


def test_the_list_needs_no_capture(run):
    code, out, _ = run("ablate", "--list")
    assert code == 0
    lines = out.splitlines()
    assert [line.split()[0] for line in lines] == list(BY_NAME)
    assert {line.split()[0] for line in lines if "baseline:" in line} == {v.name for v in VARIANTS if v.is_baseline}


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--seeds", "a"], "--seeds is 'a'"),
        (["--seeds", ""], "--seeds is ''"),
        (["--seeds", "0,0"], "only once"),
        (["--seeds", "0,-4"], "seed is -4"),
        (["--n-clips", "0"], "--n-clips is 0; the capture has 2 clips of 3 frames"),
        (["--n-clips", "3"], "--n-clips is 3"),
        (["--reference-clip", "2"], "reference clip is 2"),
        (["--reference-clip", "1", "--n-clips", "1"], "none of the 1 clips of the ablation. Choose one from 0 to 0"),
        (["--seed", "3"], "unrecognized arguments: --seed 3. See `clipgstream ablate --help`"),
        (["--variants", " , "], "--variants is ' , ', which names none"),
        (["--variants", "full,nonsense"], "no variant called nonsense"),
        (["--preset", "nonsense"], "no preset called 'nonsense'"),
        (["--metrics", "none"], "invalid choice"),
        (["--set", "field=joint"], "field=joint leaves no clips"),
        (["--set", "field=continue"], "cannot continue each other's field"),
        (["--holdout", "0,1,2"], "leaves 1 for training"),
    ],
)
def test_bad_arguments_end_with_2_and_leave_nothing_behind(run, capture_folder, tmp_path, arguments, expected):
    code, out, err = run("ablate", capture_folder, "--project", tmp_path / "a", "--clip-length", 3, *arguments)
    assert code == 2
    assert expected in err
    assert "Traceback" not in err
    assert out == ""
    assert not (tmp_path / "a").exists()


def test_a_capture_and_a_folder_are_asked_for(run, capture_folder):
    for arguments in ([], [capture_folder], ["--project", "x"]):
        code, _, err = run("ablate", *arguments)
        assert code == 2
        assert "--project are needed" in err


def test_the_command_prints_the_table(run, runner, capture_folder):
    arguments = ["ablate", capture_folder, "--project", runner.folder, "--clip-length", 3, "--variants", "decoder-new"]
    settings = ["--set", "joint_steps=6"]
    code, out, err = run(*arguments, *settings)
    assert code == 0, err
    table, _, said = out.partition("\n\n")
    assert [line.split()[0] for line in table.splitlines()[1:]] == [FULL, "decoder-new"]
    assert said.startswith("Flicker: ")
    assert 'those of the clips of "full"' in said
    code, out, _ = run(*arguments, *settings, "--json", "--quiet")
    assert code == 0
    assert json.loads(out)["n_clips"] == 2
    assert json.loads(out)["precision"] == "float"
    code, out, _ = run(*arguments, *settings, "--json", "--quiet", "--precision", "8bit")
    assert json.loads(out)["precision"] == "8bit"
    code, _, err = run(*arguments, "--set", "joint_steps=7")
    assert code == 2
    assert "other settings" in err


def test_the_reference_clip_is_that_of_every_variant_cut_alike(run, runner, capture_folder):
    code, _, err = run(
        "ablate", capture_folder, "--project", runner.folder, "--clip-length", 3, "--variants", "decoder-new,,gate-off",
        "--reference-clip", 1, "--quiet",
    )  # fmt: skip
    assert code == 0, err
    for name in (FULL, "decoder-new", "gate-off"):
        assert read_settings(project_folder(runner.folder, name, 0)).reference_clip == 1


# ---------------------------------------------------------------- presets


def test_presets_are_four_and_valid():
    assert set(PRESETS) == {"toy", "small", "medium", "paper"}
    for name in PRESETS:
        assert TrainConfig(**preset(name)).difference() == preset(name)  # none repeats a default
    assert preset("small") == {}
    preset("toy")["passes"] = 99
    assert preset("toy")["passes"] != 99


def test_the_published_sizes():
    config = TrainConfig(**preset("paper"))
    assert (config.static_feature_dim, config.dynamic_feature_dim, config.gaussians_per_anchor) == (64, 64, 10)
    assert (config.field_levels, config.field_channels, config.field_base_cells, config.field_growth) == (16, 4, 16, 2)
    assert 17 <= config.field_log2_entries <= 20
    assert config.gate == "off"
    n_pictures = 32 * 10
    assert config.n_joint_steps(n_pictures) == config.n_source_steps(n_pictures) == 34 * n_pictures == 10_880


def test_an_unknown_preset_ends_with_2_and_a_setting_changes_one(run, capture_folder, tmp_path):
    code, _, err = run("train", capture_folder, "--project", tmp_path / "p", "--preset", "nonsense")
    assert code == 2
    assert "toy, small, medium, paper" in err
    assert not (tmp_path / "p").exists()
    arguments = ("--preset", "toy", "--set", "passes=2", "--set", "joint_steps=6")
    assert run("train", capture_folder, "--project", tmp_path / "p", *arguments)[0] == 0
    assert read_settings(tmp_path / "p").overrides == preset("toy") | {"passes": 2.0, "joint_steps": 6}
