"""The benchmarks yield whole rows, a table, a document and a picture. Nothing here looks at how long anything takes."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from PIL import Image

from app.cli.cli import main
from app.lab.bench import chart, raster, suite
from app.lab.bench.chart import draw_speed_error
from app.lab.bench.command import CHART_FILE, DEFAULT_OUT
from app.lab.bench.compared import EXACT
from app.lab.bench.field import SCENES, DecodeScene, measure_decode
from app.lab.bench.fma_limit import measure_fma_limit
from app.lab.bench.iteration import SIZES, measure_iteration
from app.lab.bench.raster import evaluated_pairs, limit_shares, measure_raster
from app.lab.bench.rows import SpeedError
from app.lab.bench.scenes import RECIPES, Recipe
from app.lab.bench.step import STAGES, StepRun, StepWindow
from app.lab.bench.step_errors import measure_errors, middle
from app.lab.bench.suite import FULL, QUICK, Plan, document
from app.lab.bench.table import report_text
from app.lab.bench.timing import Timing, interleaved, peak_extra_mb
from app.lab.machine import describe_machine
from engine.backends.backend import PhotometricLoss
from engine.backends.cpu.backend import CpuBackend
from engine.backends.cpu.step.adam import CpuAdam
from engine.raster import Gaussians, Rendering
from engine.training.plan.synthetic_clip import ClipRecipe

pytestmark = pytest.mark.slow  # left out by make check, as the file takes seconds as a whole

ROOT = Path(__file__).resolve().parents[3]
TINY = Recipe(100, 32, 24, 3.0)
TINY_CLIP = ClipRecipe(60, 2, 32, 24)


@pytest.fixture
def tiny_plan(monkeypatch: pytest.MonkeyPatch) -> Plan:
    """Stands in for the quick set."""
    plan = Plan(raster=("small",), decode=("2k",), iterations=("2k",), n_runs=2, n_steps=2)
    monkeypatch.setattr(suite, "QUICK", plan)
    monkeypatch.setitem(RECIPES, "small", TINY)
    monkeypatch.setitem(SCENES, "2k", DecodeScene(TINY_CLIP))
    monkeypatch.setitem(SIZES, "2k", TINY_CLIP)
    monkeypatch.setattr("app.lab.bench.fma_limit._ROUNDS_PER_CALL", 100)
    monkeypatch.setattr("app.background.kernels.warm_cache", lambda: None)
    return plan


def marks() -> list[SpeedError]:
    return [
        SpeedError(operation, scene, "100 in 80x60", backend, ms, error, 3 * error)
        for operation in ("raster", "decode", "step")
        for scene, factor in (("small", 1.0), ("large", 7.0))
        for backend, ms, error in (("cpu", 2.0 * factor, 1e-6), ("reference", 300.0 * factor, 2e-7))
    ]


# ---------------------------------------------------------------- timing


def test_candidates_run_in_turn_and_warm_runs_do_not_count():
    calls = []

    def candidate(name: str, first_ms: float):
        def run() -> tuple[float, float]:
            calls.append(name)
            return (first_ms if calls.count(name) > 1 else 999.0), 1.0

        return run

    found = interleaved({"a": candidate("a", 5.0), "b": candidate("b", 7.0)}, 3, n_warm=1)
    assert calls == ["a", "b"] * 4
    assert found == {"a": [Timing(5.0, 5.0), Timing(1.0, 1.0)], "b": [Timing(7.0, 7.0), Timing(1.0, 1.0)]}


def prepare_allocation(n_mb: int):
    """Imported by the process that measures."""
    return lambda: np.ones(n_mb << 20, np.uint8)


@pytest.mark.slow
def test_peak_memory_sees_what_a_call_allocates():
    found = peak_extra_mb(prepare_allocation, 64)
    assert found is not None
    assert 60 < found < 80


def prepare_nothing_good(_: int):
    """Imported by the process that measures; dies there."""
    raise SystemExit(3)


@pytest.mark.slow
def test_peak_memory_of_a_process_that_dies_is_none():
    assert peak_extra_mb(prepare_nothing_good, 0) is None


# ---------------------------------------------------------------- rows


def test_a_reduced_recipe_keeps_the_overlap():
    small = RECIPES["large"].reduced()
    before, after = RECIPES["large"], small
    assert (small.width, small.height) == (80, 60)
    assert after.n_rows / (80 * 60) == pytest.approx(before.n_rows / (before.width * before.height), rel=0.01)
    assert RECIPES["accuracy"].reduced() == RECIPES["accuracy"]


def test_every_scene_of_the_plans_is_known():
    for plan in (QUICK, FULL):
        assert set(plan.raster) <= set(RECIPES)
        assert set(plan.decode) <= set(SCENES)
        assert set(plan.iterations) <= set(SIZES)
        assert plan.with_memory <= {*RECIPES, *SCENES}


def test_the_rasterizers_row_has_speed_and_error():
    row, found = measure_raster("tiny", n_runs=2, has_memory=False, recipe=TINY)
    assert row.forward.min_ms > 0
    assert row.backward.median_ms >= row.backward.min_ms > 0
    assert 0 < row.value_error < 1e-5
    assert 0 < row.gradient_error < 1e-4
    assert row.reference_ratio > 0
    assert [mark.backend for mark in found] == ["cpu", "reference"]
    forward, backward = limit_shares(row, 1e9) or (0, 0)
    assert forward == pytest.approx((row.forward_pairs_per_s or 0) * raster.FORWARD_OPERATIONS / 16e9)
    assert backward > 0


def test_pairs_count_blocks_that_a_gaussian_reaches():
    n_pairs = evaluated_pairs(TINY.scene())
    assert n_pairs % 16 == 0
    assert 16 * TINY.n_rows / 4 < n_pairs < TINY.n_rows * 32 * 24


def test_the_decodes_row_has_speed_and_error():
    row, found = measure_decode("tiny", n_runs=2, has_memory=False, scene=DecodeScene(TINY_CLIP))
    assert 0 < row.value_error < 1e-5
    assert 0 < row.gradient_error < 1e-4
    assert limit_shares(row, 1e9) is None
    assert [mark.operation for mark in found] == ["decode", "decode"]


@pytest.mark.slow
@pytest.mark.parametrize("is_source", [False, True])
def test_a_training_step_is_cut_into_stages(is_source):
    row, found = measure_iteration("tiny", is_source=is_source, n_runs=2, recipe=TINY_CLIP)
    assert tuple(name for name, _ in row.stages) == STAGES
    assert row.n_gaussians == 120
    assert row.total.min_ms > 0
    assert row.scene == ("source" if is_source else "joint")
    assert [(mark.operation, mark.backend) for mark in found] == [("step", "cpu"), ("step", "reference")]


def test_cut_steps_learn_the_same_as_whole_ones():
    runs = [StepRun(TINY_CLIP), StepRun(TINY_CLIP)]
    for _ in range(3):
        runs[0].whole()
        runs[1].staged()
    first, second = (dict(run._model.named_parameters()) for run in runs)
    moved = StepRun(TINY_CLIP)._model
    for name, parameter in first.items():
        np.testing.assert_allclose(parameter.detach(), second[name].detach(), rtol=1e-4, atol=1e-6, err_msg=name)
    assert any(not np.array_equal(p.detach(), first[name].detach()) for name, p in moved.named_parameters())


@pytest.mark.slow
@pytest.mark.parametrize("is_source", [False, True])
def test_the_steps_row_has_speed_and_error(is_source):
    errors, found = measure_errors(replace(TINY_CLIP, is_source=is_source), scene="tiny")
    assert errors.checked_at == "32x24"
    assert 0 < errors.value_error < 1e-5
    assert errors.loss_error < 1e-5
    assert 0 < errors.gradient_error < 1e-4
    assert errors.worst_gradient in dict(StepRun(replace(TINY_CLIP, is_source=is_source))._parameters)
    assert 0 < errors.update_error < 1e-3
    assert all(mark.total_ms > 0 and mark.gradient_error < 1e-4 for mark in found.values())


def test_a_step_in_a_window_draws_that_part_of_the_picture():
    window = StepWindow(8, 5, 16, 12)
    whole, part = StepRun(TINY_CLIP, backend=EXACT).kept(), StepRun(TINY_CLIP, backend=EXACT, window=window).kept()
    expected, shifted = whole.image[5:17, 8:24], whole.image[6:18, 8:24]
    assert (part.image - expected).abs().mean() < 0.005  # not zero: footprints beyond a border are held at its slope
    assert (part.image - shifted).abs().mean() > 0.01
    assert part.image.std() > 0.05
    assert part.gradients.keys() == whole.gradients.keys()
    assert middle(ClipRecipe(10, 1, 480, 360)) == StepWindow(208, 156, 64, 48)


class _Skewed(torch.autograd.Function):
    """Nothing forward; a gradient one percent too large."""

    @staticmethod
    def forward(ctx: Any, tensor: torch.Tensor) -> torch.Tensor:
        return tensor.view_as(tensor)

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> torch.Tensor:
        return 1.01 * gradients[0]


def skewed(tensor: torch.Tensor) -> torch.Tensor:
    return _Skewed.apply(tensor)  # pyright: ignore[reportReturnType] - apply is untyped


class HastyAdam(CpuAdam):
    """Learns one percent too fast."""

    def step(self, gradients: Any, rates: Any, **options: Any) -> torch.Tensor:
        return super().step(gradients, {name: 1.01 * rate for name, rate in rates.items()}, **options)


class WrongBackend(CpuBackend):
    """The cpu back end with one wrong operation."""

    def __init__(self, operation: str) -> None:
        self.operation = operation

    def rasterize(self, *arguments: Any, **options: Any) -> Rendering:
        found = super().rasterize(*arguments, **options)
        if self.operation == "picture":
            return replace(found, image=found.image + 0.01)
        return replace(found, image=skewed(found.image)) if self.operation == "rasterizer" else found

    def decode(self, *arguments: Any, **options: Any) -> Gaussians:
        found = super().decode(*arguments, **options)
        return replace(found, scales=skewed(found.scales)) if self.operation == "decode" else found

    def photometric_loss(self, *arguments: Any, **options: Any) -> PhotometricLoss:
        found = super().photometric_loss(*arguments, **options)
        return replace(found, loss=skewed(found.loss)) if self.operation == "loss" else found

    def adam(self, parameters: Mapping[str, torch.Tensor]) -> CpuAdam:
        return (HastyAdam if self.operation == "adam" else CpuAdam)(parameters)


FAULTS = {
    "picture": {"value_error", "loss_error", "gradient_error"},
    "rasterizer": {"gradient_error"},
    "decode": {"gradient_error"},
    "loss": {"gradient_error"},
    "adam": {"update_error"},
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_a_wrong_back_end_shows_in_its_column_and_in_no_other(fault):
    errors, _ = measure_errors(TINY_CLIP, scene="tiny", fast=WrongBackend(fault))
    columns = ("value_error", "loss_error", "gradient_error", "update_error")
    assert {column for column in columns if getattr(errors, column) > 2e-3} == FAULTS[fault]


def test_the_limit_is_a_plausible_number_of_operations(monkeypatch):
    monkeypatch.setattr("app.lab.bench.fma_limit._ROUNDS_PER_CALL", 100)
    assert 1e6 < measure_fma_limit(seconds=0.0) < 1e13


# ---------------------------------------------------------------- what comes of it


@pytest.mark.slow
def test_the_command_prints_a_table_and_writes_document_and_picture(tiny_plan, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["bench", "--out", str(out), "--json", str(tmp_path / "b.json")]) == 0
    said = capsys.readouterr()
    assert "raster small" in said.out
    assert "decode 2k" in said.out
    assert "joint, 60 anchors" in said.out
    assert "value err" in said.out
    assert "update err" in said.out
    assert describe_machine(1).cpu in said.out
    assert "Measuring" in said.err
    found = json.loads((tmp_path / "b.json").read_text())
    assert found["schema"] == 1
    assert [row["operation"] for row in found["kernels"]] == ["raster", "decode"]
    assert [row["scene"] for row in found["iterations"]] == ["joint", "source"]
    assert all(0 < row["errors"]["gradient_error"] < 1e-4 for row in found["iterations"])
    assert {mark["operation"] for mark in found["speed_error"]} == {"raster", "decode", "step"}
    assert all(math.isfinite(mark["gradient_error"]) for mark in found["speed_error"])
    assert is_picture(out / CHART_FILE)


@pytest.fixture
def empty_plan(tiny_plan, tmp_path, monkeypatch):
    """Nothing is measured, and the picture is a word; in an empty current folder."""
    monkeypatch.setattr(suite, "QUICK", Plan())
    monkeypatch.setattr(chart, "draw_speed_error", lambda marks, path, **_options: path.write_text("picture"))
    monkeypatch.chdir(tmp_path)


def test_json_on_standard_output_is_only_json(empty_plan, capsys):
    assert main(["bench", "--json", "-", "--quiet"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["fma_per_s"] > 0
    assert said.err == ""


def test_the_picture_lies_in_the_current_folder_unless_told_where(empty_plan, tmp_path, capsys):
    assert main(["bench"]) == 0
    assert (tmp_path / DEFAULT_OUT / CHART_FILE).read_text() == "picture"
    assert str(DEFAULT_OUT / CHART_FILE) in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--threads", "0"), "--threads is 0"),
        (("--threads", "many"), "invalid int value"),
        (("--out", "FILE"), "is a file"),
        (("--json", "FOLDER"), "This is a folder"),
    ],
)
def test_bad_arguments_end_with_2_before_anything_is_measured(monkeypatch, tmp_path, capsys, arguments, expected):
    monkeypatch.setattr(suite, "run_plan", lambda *a, **k: pytest.fail("measured all the same"))
    (tmp_path / "file").write_text("")
    places = {"FILE": str(tmp_path / "file"), "FOLDER": str(tmp_path)}
    assert main(["bench", *(str(places.get(word, word)) for word in arguments)]) == 2
    assert expected in capsys.readouterr().err


def test_an_interrupt_is_told_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)

    def interrupted(*arguments: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(suite, "run_plan", interrupted)
    assert main(["bench"]) == 130
    assert capsys.readouterr().err.strip() == "clipgstream: Interrupted."


@pytest.mark.slow
def test_the_picture_shows_every_operation(tmp_path):
    for operations, height in ((("raster",), 400), (("raster", "decode"), 700), (("raster", "decode", "step"), 1000)):
        path = tmp_path / f"{len(operations)}.png"
        draw_speed_error([mark for mark in marks() if mark.operation in operations], path, footer="a machine")
        assert is_picture(path)
        with Image.open(path) as image:
            assert image.size[1] > height


def test_a_picture_of_nothing_is_refused(tmp_path):
    with pytest.raises(ValueError, match="no marks"):
        draw_speed_error([], tmp_path / "none.png", footer="")


@pytest.mark.slow
def test_errors_of_zero_have_a_place_in_the_picture(tmp_path):
    draw_speed_error([replace(mark, value_error=0.0) for mark in marks()], tmp_path / "zero.png", footer="")
    assert is_picture(tmp_path / "zero.png")


def test_a_report_without_rows_is_still_text(tiny_plan):
    report = suite.run_plan(Plan())
    assert "multiply-adds" in report_text(report)
    assert document(report)["kernels"] == []


def test_only_drawing_imports_matplotlib():
    probe = "import app.cli.cli, app.lab.bench.suite, app.lab.bench.chart, sys; print('matplotlib' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", probe], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def is_picture(path: Path) -> bool:
    """A PNG in which more is drawn than a background."""
    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB"))
    return image.format == "PNG" and len(np.unique(pixels.reshape(-1, 3), axis=0)) > 20 and float(pixels.std()) > 5
