"""Copies of projects on computers that do not see them: files by content, links, and what is sent. Without Ray."""

from __future__ import annotations

import os
import threading
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace

import pytest
from msgspec.structs import replace

from app.cluster import mirror as mirror_module
from app.cluster.cluster import Cluster
from app.cluster.connecting import connect
from app.cluster.contents import HEAD_BYTES, contents_of, job_key
from app.cluster.mirror import Mirror, file_digest
from app.cluster.nodes import Node, take_seat
from app.cluster.versions import difference, versions
from app.project.opening.project_access import create_project, default_settings
from app.training.jobs import train_job
from engine.capture.capture import open_capture
from engine.errors import DiskError, EngineError, ProjectError
from tests.app.fakes import write_capture, write_trained
from tests.faults.record import Recorder


def put(mirror: Mirror, folder: Path, data: bytes) -> str:
    """Send a content in two parts."""
    (folder / "source").write_bytes(data)
    digest = file_digest(folder / "source")
    mirror.put([(digest, 0, data[:3], False)])
    mirror.put([(digest, 3, data[3:], True)])
    return digest


def test_contents_are_kept_once_and_linked_to_their_names(tmp_path: Path) -> None:
    mirror = Mirror("a", tmp_path / "m")
    digest = put(mirror, tmp_path, b"a video")
    assert mirror.missing([digest, "0" * 40, digest]) == ["0" * 40]
    names = [("capture/a.mp4", digest), ("capture/b/c.mp4", digest), ("project/metrics/0000.unfinished.jsonl", digest)]
    assert mirror.build(names, "0000") == -1
    assert (mirror.capture / "a.mp4").read_bytes() == b"a video"
    assert os.stat(mirror.capture / "b" / "c.mp4").st_nlink == 3
    with open(mirror.project / "metrics" / "0000.unfinished.jsonl", "a") as file:
        file.write("more")  # what a training appends to is its own
    assert mirror.missing([digest]) == []
    assert file_digest(mirror.capture / "a.mp4") == digest
    assert mirror.read("metrics/0000.unfinished.jsonl", 2, 5) == b"video"
    assert mirror.read("live/none", 0, 5) == b""
    mirror.build(names[1:], "0000")
    assert not (mirror.capture / "a.mp4").exists()
    mirror.forget()
    assert not mirror.folder.exists()


def test_a_content_that_arrives_damaged_is_refused(tmp_path: Path) -> None:
    mirror = Mirror("a", tmp_path)
    with pytest.raises(DiskError, match="arrived damaged"):
        mirror.put([("1" * 40, 0, b"other", True)])
    assert mirror.missing(["1" * 40]) == ["1" * 40]


@pytest.mark.parametrize("name", ["../../outside", "/outside", "capture/../../../outside"])
def test_no_name_leads_out_of_the_copy(tmp_path: Path, name: str) -> None:
    mirror = Mirror("a", tmp_path / "m")
    digest = put(mirror, tmp_path, b"data")
    with pytest.raises(ValueError, match="leads out"):
        mirror.build([(name, digest)], "0000")


def test_two_processes_never_share_a_copy(tmp_path: Path) -> None:
    first, second = Mirror("a", tmp_path), Mirror("a", tmp_path)
    assert first.folder != second.folder


def test_the_cache_is_bounded_and_used_contents_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mirror_module, "MAX_BYTES", 10)
    other, mirror = Mirror("b", tmp_path / "m"), Mirror("a", tmp_path / "m")
    used, old, new = (put(mirror, tmp_path, data) for data in (b"used it", b"8 bytes.", b"8 bytes!"))
    other.build([("capture/a", used)], "0000")
    os.utime(tmp_path / "m" / "files" / old, (1, 1))
    os.utime(tmp_path / "m" / "files" / used, (0, 0))
    mirror.forget()
    assert other.missing([used, old, new]) == [old]


def test_a_disk_that_refuses_is_a_disk_error(tmp_path: Path) -> None:
    (tmp_path / "m").write_text("a file")
    with pytest.raises(DiskError):
        Mirror("a", tmp_path / "m")


def test_of_pictures_only_those_of_the_clip_are_sent_in_full(make_opened, tmp_path: Path) -> None:
    opened = make_opened()
    write_trained(opened, 0)
    jobs = [train_job(opened.project, clip, holdout=opened.holdout) for clip in opened.clips]
    names = [f"capture/ims/0/{frame:06d}.jpg" for frame in range(6)]

    def folder_of(key: str) -> Path:
        (tmp_path / key).mkdir()
        return tmp_path / key

    for job, in_full in ((jobs[0], range(6)), (jobs[1], range(3, 6))):
        found = {
            content.name: content
            for content in contents_of(opened.project, opened.capture, job, folder_of(job.key), is_whole=False)
        }
        sizes = [found[name].n_bytes for name in names]
        assert sizes == [
            found[name].path.stat().st_size if frame in in_full else min(HEAD_BYTES, found[name].path.stat().st_size)
            for frame, name in enumerate(names)
        ]
        assert ("project/clips/0000.safetensors" in found) == (job is jobs[1])
        assert {"project/project.json", "capture/train_meta.json"} < found.keys()
    assert job_key(opened.project, jobs[0]) != job_key(opened.project, jobs[1])
    again = replace(jobs[0], claim="c" * 32, n_beside=7, n_everywhere=9, n_threads=3)
    assert job_key(opened.project, again) == job_key(opened.project, jobs[0]), "another process continues with its copy"


def test_a_copy_of_a_capture_that_was_followed_is_understood_like_it(tmp_path: Path) -> None:
    source = open_capture(write_capture(tmp_path / "source"))
    recorder = Recorder(source, tmp_path / "c", lost=[("2", 4)])
    for tick in range(source.n_frames):
        recorder.write(tick)
    capture = open_capture(tmp_path / "c", is_growing=True)
    settings = default_settings(capture, clip_length=3, overrides={"backgrounds": "clip"})
    project = create_project(tmp_path / "p", settings)
    job = train_job(project, project.clips(capture.n_frames)[0], holdout=(0,))
    (tmp_path / "made").mkdir()
    contents = contents_of(project, capture, job, tmp_path / "made", is_whole=False)
    assert "capture/ims/2/000004.jpg" not in [content.name for content in contents]
    mirror = Mirror("a", tmp_path / "m")
    for content in contents:
        mirror.put([(content.digest, 0, content.path.read_bytes()[: content.n_bytes], True)])
    mirror.build([(content.name, content.digest) for content in contents], job.key)
    assert open_capture(mirror.capture, is_growing=True).fingerprint == job.fingerprint
    project.close()


# ---------------------------------------------------------------- places and addresses


def test_a_clip_alone_has_a_whole_computer_and_many_have_a_core_each() -> None:
    nodes = [Node("a", "a", 4, 10, sees_project=True), Node("b", "b", 2, 10, sees_project=True)]
    alone = take_seat(nodes, 2, n_beside=1)
    assert alone is not None
    assert (alone.node, alone.n_threads) == (nodes[0], 4)
    alone.leave()
    seats = [take_seat(nodes, 2, n_beside=6) for _ in range(7)]
    assert [seat.n_threads for seat in seats if seat is not None] == [1] * 6
    assert seats[6] is None


def test_memory_limits_the_clips_of_a_computer_and_a_refused_one_gets_none() -> None:
    nodes = [Node("a", "a", 4, 5, sees_project=True), Node("b", "b", 4, 100, sees_project=True, refused="is full")]
    assert [take_seat(nodes, 2, n_beside=9) is not None for _ in range(3)] == [True, True, False]
    avoided = Node("c", "c", 8, 100, sees_project=True)
    nodes[0].n_clips = 0
    seat = take_seat([*nodes, avoided], 2, n_beside=9, avoided=[avoided])
    assert seat is not None
    assert seat.node is nodes[0]


def test_other_versions_are_named() -> None:
    here = versions()
    assert difference(here) == ""
    assert difference(here | {"numba": "0.1"}) == f"has numba 0.1 (here {here['numba']})"
    assert difference(here | {"ClipGStream": "x"}) == "has another version of ClipGStream"


@pytest.mark.parametrize("address", ["", "local:", "local:x", "somewhere", "ray://a:1", "a:b", "a:1:2"])
def test_an_address_that_is_none_is_bad_input(address: str) -> None:
    with pytest.raises(ProjectError, match="is not the address of a cluster"):
        connect(address, SimpleNamespace())  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("address", ["127.0.0.1:1", "127.0.0.1:70000"])
def test_an_address_at_which_nothing_listens_is_said_at_once(address: str) -> None:
    with pytest.raises(EngineError, match=rf"The cluster at {address} cannot be reached"):
        connect(address, SimpleNamespace())  # pyright: ignore[reportArgumentType]


def test_a_cluster_that_a_thread_has_started_outlives_that_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes of Ray end with the thread that started them, and the window joins on one that ends then."""
    started_by: list[threading.Thread] = []
    ray = SimpleNamespace(init=lambda **_: started_by.append(threading.current_thread()))
    monkeypatch.setattr("app.cluster.connecting.ray_library", lambda: ray)
    monkeypatch.setattr(os, "environ", dict(os.environ))
    with ExitStack() as kept:
        thread = threading.Thread(target=connect, args=("local:1", kept))
        thread.start()
        thread.join(60)
        assert started_by[0].is_alive()
        assert not thread.is_alive()
    started_by[0].join(60)
    assert not started_by[0].is_alive()


def test_without_ray_the_remedy_is_said(make_opened, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    opened = make_opened()
    with pytest.raises(ProjectError, match=r"Ray is not installed\. .*pip install clipgstream\[cluster\]"):
        Cluster("auto", opened.project, opened.capture, n_bytes=1)
