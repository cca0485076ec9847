"""What the files of a project say of its clips: many of them, chained ones, stale ones, damaged ones."""

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest

from app.project.clips.clip_catalog import ClipCatalog, anchor_counts
from app.project.project import Project
from app.training.messages import TrainJob
from app.training.process import Worker
from app.training.service import TrainingService
from app.training.training_status import ClipStatuses
from engine.capture.clip import split_clips
from engine.clip_files.clip_header import ClipHeader
from engine.clip_files.clip_state import DamagedClip, look_at_clip, read_clip_header
from tests.app.made_projects import clip_header, make_chain, make_project, write_header
from tests.clip_headers import changed, header_values, write_values


def states(catalog: ClipCatalog) -> list[str]:
    return [catalog[index].state for index in range(len(catalog))]


def never(job: TrainJob, project: Project) -> Worker:
    raise AssertionError("nothing trains here")


def state_by_definition(project: Project, clip_index: int) -> str:
    """What a state means, one clip at a time: the slow and recursive way."""

    def is_stale(index: int, header: ClipHeader) -> bool:
        if header.role == "source":
            reference = read_clip_header(project.reference_path)
            if reference is None or reference.fingerprint != header.reference_fingerprint:
                return True
        if header.previous_fingerprint is None:
            return False
        before = project.previous_index(index)
        previous = read_clip_header(project.clip_path(before))
        if previous is None or previous.fingerprint != header.previous_fingerprint:
            return True
        return is_stale(before, previous)

    header = read_clip_header(project.clip_path(clip_index))
    kept = read_clip_header(project.checkpoint_path(clip_index))
    state = "untrained" if header is None else "stale" if is_stale(clip_index, header) else "trained"
    return "stopped" if kept is not None and state != "trained" else state


@pytest.mark.parametrize("seed", range(40))
def test_every_state_is_the_one_by_definition(tmp_path: Path, seed: int) -> None:
    drawn = random.Random(seed)
    n_clips, first = 7, drawn.randrange(3)
    independent = drawn.random() < 0.3
    project = make_project(tmp_path, reference_clip=first, overrides={"independent": independent})
    is_chained = drawn.random() < 0.7
    for index in project.training_order(n_clips):
        entries: dict[str, object] = {}
        if index != first and not independent:
            entries |= {"role": "source", "reference_fingerprint": drawn.choice([f"clip-{first}"] * 9 + ["older"])}
        if index != first and is_chained:
            before = project.previous_index(index)
            entries["previous_fingerprint"] = drawn.choice([f"clip-{before}"] * 9 + ["older"])
        if drawn.random() < 0.9:
            write_header(project.clip_path(index), clip_header(index, **entries))
        if drawn.random() < 0.2:  # of a training that can go on: those of an older reference are another test
            entries = {name: value for name, value in entries.items() if name == "previous_fingerprint"}
            write_header(project.checkpoint_path(index), clip_header(index, **entries, step=3))
    expected = [state_by_definition(project, index) for index in range(n_clips)]
    assert states(ClipCatalog(project, n_clips)) == expected


@pytest.mark.parametrize("seed", range(25))
def test_whatever_happens_it_says_what_one_made_anew_would_say(tmp_path: Path, seed: int) -> None:
    drawn = random.Random(seed)
    n_clips, first = 8, drawn.randrange(3)
    overrides = {"field": "continue"} if drawn.random() < 0.6 else {}
    project = make_project(tmp_path, reference_clip=first, overrides=overrides)
    service = TrainingService(project, split_clips(n_clips, 1), holdout=(), launch=never)
    catalog, statuses = service.catalog, ClipStatuses(service)

    def change(index: int) -> None:
        path = drawn.choice([project.clip_path, project.checkpoint_path])(index)
        entries: dict[str, object] = {"fingerprint": drawn.choice([f"clip-{index}"] * 3 + ["another"])}
        if index != first:
            entries |= {"role": "source", "reference_fingerprint": drawn.choice([f"clip-{first}"] * 6 + ["older"])}
            entries["previous_fingerprint"] = f"clip-{project.previous_index(index)}" if overrides else None
        match drawn.choice(["write"] * 4 + ["remove", "spoil"]):
            case "remove":
                path.unlink(missing_ok=True)
            case "spoil" if path.is_file():
                spoil(path)
            case _:
                write_header(path, clip_header(index, **entries, step=drawn.randrange(6)))
        catalog.update(index)

    for _ in range(30):
        index = drawn.randrange(n_clips)
        change(index)
        match drawn.choice(["wait", "leave", "fail", ""]):
            case "wait":
                service.queue.add(index)
            case "leave":
                service.queue.remove(index)
            case "fail":
                service.queue.failed[index] = f"reason {drawn.random()}"
        new = ClipCatalog(project, n_clips)
        assert catalog.records == new.records
        assert (catalog.n_trained, catalog.has_finished_clips) == (new.n_trained, new.has_finished_clips)
        assert catalog.due == new.due == {i for i, record in enumerate(new.records) if record.is_due}
        assert statuses.all() == ClipStatuses(service).all()
        free = [i for i in catalog.order if i in new.due and i not in service.queue]
        expected = next(iter(service.queue), None) if service.queue else next(iter(free), None)
        assert service.next_clip_index == expected


@pytest.mark.slow
def test_a_thousand_clips_that_go_on_from_each_other_are_read_in_one_pass(tmp_path: Path) -> None:
    n_clips = 1000
    project = make_chain(tmp_path, n_clips)
    catalog = ClipCatalog(project, n_clips)
    assert states(catalog) == ["trained"] * n_clips
    assert catalog.outdated_by(900) == list(range(901, n_clips))
    assert catalog.outdated_by(0) == list(range(1, n_clips))
    assert catalog.outdated_by(n_clips - 1) == []
    write_header(
        project.clip_path(500), clip_header(500, role="source", reference_fingerprint="clip-0", fingerprint="x")
    )
    catalog.update(500)
    assert states(catalog) == ["trained"] * 501 + ["stale"] * 499
    assert "Clip 500" in catalog[501].reason
    assert "out of date" in catalog[999].reason


def test_who_trains_one_clip_reads_no_others(tmp_path: Path) -> None:
    project = make_chain(tmp_path, 5)
    assert states(ClipCatalog(project, 5, only=(0, 3))) == ["trained", "untrained", "untrained", "stale", "untrained"]
    assert len(project.headers) == 2


def test_each_header_is_read_once_while_its_file_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    project = make_chain(tmp_path, 20)
    read: list[str] = []

    def counted(path: Path) -> ClipHeader | DamagedClip | None:
        read.append(path.name)
        return look_at_clip(path)

    monkeypatch.setattr("app.project.clips.header_cache.look_at_clip", counted)
    catalog = ClipCatalog(project, 20)
    assert sorted(read) == [f"{index:04d}.safetensors" for index in range(20)]
    ClipCatalog(project, 20)
    assert len(read) == 20
    write_header(project.clip_path(7), clip_header(7, fingerprint="another"))
    catalog.update(7)
    assert read[20:] == ["0007.safetensors"]


def spoil(path: Path) -> None:
    path.write_bytes(b"\xff" * 64)


def without_steps(path: Path) -> None:
    values = header_values()
    del values["step"]
    write_values(path, {}, values)


def with_a_word_for_steps(path: Path) -> None:
    write_values(path, {}, header_values(step="many"))


@pytest.mark.parametrize("damage", [spoil, without_steps, with_a_word_for_steps])
def test_a_damaged_clip_is_neither_trained_nor_due(tmp_path: Path, damage) -> None:
    project = make_project(tmp_path)
    for index in range(3):
        source = {"role": "source", "reference_fingerprint": "clip-0"}
        write_header(project.clip_path(index), clip_header(index, **(source if index else {})))
    damage(project.clip_path(1))
    service = TrainingService(project, split_clips(4, 1), holdout=())
    assert states(service.catalog) == ["trained", "damaged", "trained", "untrained"]
    assert "damaged" in service.catalog[1].reason
    assert service.catalog.n_trained == 2
    assert service.next_clip_index == 3


def test_what_stands_on_a_damaged_clip_is_not_trained_again_either(tmp_path: Path) -> None:
    project = make_chain(tmp_path, 5)
    spoil(project.clip_path(2))
    service = TrainingService(project, split_clips(6, 1), holdout=())
    assert states(service.catalog) == ["trained", "trained", "damaged", "stale", "stale", "untrained"]
    assert [service.catalog[index].blocked_by for index in range(6)] == [None, None, None, 2, 2, 2]
    assert service.next_clip_index is None


def test_a_checkpoint_of_another_reference_cannot_be_gone_on_from(tmp_path: Path) -> None:
    project = make_project(tmp_path)
    write_header(project.clip_path(0), clip_header(0))
    kept = {"role": "source", "step": 3}
    write_header(project.checkpoint_path(1), clip_header(1, **kept, reference_fingerprint="clip-0"))
    write_header(project.checkpoint_path(2), clip_header(2, **kept, reference_fingerprint="older"))
    spoil(project.checkpoint_path(3))
    catalog = ClipCatalog(project, 4)
    assert states(catalog) == ["trained", "stopped", "untrained", "untrained"]
    assert [catalog[index].resume_step for index in range(4)] == [None, 3, None, None]
    assert "retrained after the stop" in catalog[2].reason
    assert "cannot be read" in catalog[3].reason


def test_a_training_again_that_was_stopped_leaves_the_finished_clip_as_it_is(tmp_path: Path) -> None:
    project = make_project(tmp_path)
    write_header(project.clip_path(0), clip_header(0))
    write_header(project.checkpoint_path(0), clip_header(0, step=3, fingerprint="unfinished"))
    project.unfinished_metrics_path(0).parent.mkdir()
    project.unfinished_metrics_path(0).write_text(json.dumps({"step": 3, "held_out_psnr": 11.0}) + "\n")
    record = ClipCatalog(project, 1)[0]
    assert (record.state, record.step, record.held_out_psnr, record.resume_step) == ("trained", 6, 20.0, 3)
    assert record.file == project.clip_path(0)


def test_figures_of_a_stopped_training_come_from_its_curves(tmp_path: Path) -> None:
    project = make_project(tmp_path)
    for index, path in ((0, project.unfinished_metrics_path(0)), (1, project.metrics_path(1))):  # 1: an earlier version
        write_header(project.checkpoint_path(index), clip_header(index, step=3))
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(b'{"step": 2, "held_out_psnr": 11.5}\n\xff\xfe{"step": 3\n')
    catalog = ClipCatalog(project, 2)
    assert [catalog[index].held_out_psnr for index in range(2)] == [11.5, 11.5]


def test_anchors_of_clips_that_nobody_looked_at_are_known_from_their_headers(tmp_path: Path) -> None:
    project = make_project(tmp_path)
    reference = {"static": 300, "moving": 40}
    source = {"role": "source", "reference_fingerprint": "clip-0"}
    write_header(project.clip_path(0), clip_header(0, n_anchors=reference))
    write_header(project.clip_path(1), clip_header(1, n_anchors=reference | {"residual": 7}, **source))
    write_header(project.checkpoint_path(2), clip_header(2, n_anchors=reference | {"residual": 9}, **source))
    write_header(project.clip_path(3), clip_header(3, **source))
    service = TrainingService(project, split_clips(5, 1), holdout=())
    counts = [(status.n_inherited, status.n_own) for status in ClipStatuses(service).all()]
    assert counts == [(0, 340), (340, 7), (340, 9), (0, 0), (0, 0)]


def test_anchors_that_a_clip_learns_on_are_its_own_as_in_the_picture(tmp_path: Path) -> None:
    """With inherit=trainable the file holds them, and the window draws them as the clip's own."""
    header = clip_header(
        1,
        role="source",
        reference_fingerprint="clip-0",
        n_anchors={"static": 300, "residual": 7},
        config={"inherit": "trainable"},
    )
    assert anchor_counts(header) == (0, 307)
    assert anchor_counts(changed(header, config={"inherit": "moving"})) == (300, 7)
