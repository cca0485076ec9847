"""Which back end a process computes with: what may be named, what is the best one, and who is told."""

from __future__ import annotations

import pytest
import torch

from app.export.queue.export_jobs import ExportTask
from app.mending.request import MendJob, MendRequest
from app.session.projects.preferences import Preferences
from app.training.messages import TrainJob
from engine.backends import table
from engine.backends.reference.backend import ReferenceBackend
from engine.backends.table import (
    AUTO,
    BACKENDS,
    BackendEntry,
    backend_called,
    choose_backend,
    chosen_name,
    process_backend,
)
from engine.capture.clip import Clip
from engine.errors import ProjectError
from engine.kernels import compile_ahead


class Unfit(ReferenceBackend):
    def is_available(self) -> bool:
        return False


@pytest.fixture(autouse=True)
def own_choice(monkeypatch):
    """The choice of the process of the tests stays as it is."""
    monkeypatch.setattr(table, "_chosen", AUTO)
    table._best.cache_clear()
    yield
    table._best.cache_clear()


@pytest.fixture
def unfit(monkeypatch) -> str:
    """A back end that is the first of the table and does not work here."""
    others = dict(BACKENDS)
    BACKENDS.clear()
    monkeypatch.setitem(BACKENDS, "unfit", BackendEntry(f"{__name__}:Unfit", "none"))
    BACKENDS.update(others)
    return "unfit"


def test_a_back_end_is_called_by_name_and_device():
    assert backend_called("cpu").name == "cpu"
    assert backend_called("reference:cpu").device == torch.device("cpu")
    assert backend_called("reference:cpu").name == "reference"


@pytest.mark.parametrize("name", ["quick", "", "cpu:cpu", "reference:", "reference:toaster", "reference:cuda:99"])
def test_others_do_not_exist_or_do_not_work_here(name):
    with pytest.raises(ProjectError, match=r"does not exist|does not work") as caught:
        backend_called(name)
    assert "auto, cpu, reference[:DEVICE]" in str(caught.value)


def test_without_a_choice_it_is_the_best_one_that_works(unfit, monkeypatch):
    assert next(iter(BACKENDS)) == unfit
    assert process_backend().name == "cpu"
    choose_backend(unfit)
    with pytest.raises(ProjectError, match="does not work on this machine"):
        process_backend()


def test_a_choice_holds_for_the_process_and_the_jobs_of_its_children():
    with pytest.raises(ProjectError, match="quick"):
        choose_backend("quick")
    assert chosen_name() == AUTO
    choose_backend("reference:cpu")
    assert process_backend() is backend_called("reference:cpu")
    job = TrainJob("0000", Clip(0, 0, 3, 3), "f")
    tasks = [job, MendJob("p", MendRequest(after=0), "f"), ExportTask(None, "p", "c", 1.0, None, False)]  # type: ignore[arg-type]
    assert [task.backend for task in tasks] == 3 * ["reference:cpu"]


def test_a_preference_that_is_gone_leaves_the_best_one(caplog):
    Preferences(backend="reference").choose_backend()
    assert chosen_name() == "reference"
    choose_backend(AUTO)
    Preferences(backend="gone").choose_backend()
    assert chosen_name() == AUTO
    assert "'gone' does not exist" in caplog.text


def test_a_back_end_without_compiled_kernels_compiles_none(monkeypatch, tmp_path):
    asked: list[str] = []

    def note(groups, _):
        asked.extend(name for name, _, _ in groups)
        return []  # for no process

    monkeypatch.setenv(compile_ahead.VARIABLE, str(tmp_path))
    monkeypatch.setattr(compile_ahead, "_bundles", note)
    monkeypatch.setattr(compile_ahead, "import_own", lambda name: pytest.fail(f"{name} was loaded"))
    backend = backend_called("reference")
    for _ in range(2):  # the second time it is known that they are compiled
        assert compile_ahead.compile_all(backend=backend.name)
        backend.warm_up(is_training=True)
    assert asked == [name for name, _, _ in compile_ahead.GROUPS if name not in compile_ahead.OF_CPU]
    assert compile_ahead.compile_all(backend="cpu")
    assert asked[-len(compile_ahead.GROUPS) :] == [name for name, _, _ in compile_ahead.GROUPS]
