"""Claims of clips: one holder at a time, whoever dies, stalls, or has another clock; without locks."""

from __future__ import annotations

import json
import multiprocessing
import os
import threading
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from app.project.claims.asks import ask_holder
from app.project.claims.claim_files import CLAIMS, ClaimFile, holder_path, list_claims, make_claim
from app.project.claims.claims import DEAD_AFTER_S, LOOK_EVERY_S, Claims, ClipClaimed, check_claim
from app.project.claims.holder_record import ClipProgress, HolderRecord, read_holder, write_holder
from app.project.claims.left_over import check_unclaimed, live_claims, sweep_claims
from app.project.lock import this_process
from engine.errors import DiskError, ProjectError
from engine.storage.process_space import boot_id, pid_space

KEY = "0003"


class Clock:
    """Seconds that pass when told to."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def watch(claims: Claims, clock: Clock, seconds: float) -> None:
    """Let time pass while a process looks."""
    until_s = clock.now_s + seconds
    while clock.now_s < until_s:
        clock.now_s = min(clock.now_s + LOOK_EVERY_S, until_s)
        claims.look()


def make(folder: Path, clock: Clock | None = None) -> Claims:
    return Claims(folder, clock=clock or Clock(), has_thread=False)


def take_over(claims: Claims, clock: Clock) -> None:
    """Watch the holder of a clip until it counts as dead, and claim the clip."""
    for _ in range(int(DEAD_AFTER_S / LOOK_EVERY_S)):
        with pytest.raises(ClipClaimed):
            claims.take(KEY)
        clock.now_s += LOOK_EVERY_S
    claims.take(KEY)


def look_dead(folder: Path, claims: Claims) -> None:
    """Let the holder look like one of another computer, of which only its silence tells."""
    path = holder_path(folder, claims.token)
    record = read_holder(path)
    assert record is not None
    write_holder(path, msgspec.structs.replace(record, owner=replace(record.owner, host="far", boot="x", machine="x")))


def far_away(folder: Path, *, beat: int = 1, key: str = KEY, number: int = 1) -> HolderRecord:
    """A claim of a process of another computer, whose process nobody here can look at."""
    (folder / CLAIMS).mkdir(exist_ok=True)
    owner = replace(this_process(), host="render-7", machine="another", boot="another", pid=1)
    record = HolderRecord("f" * 32, owner, clips={key: ClipProgress(3, "running", "render-7", step=5, n_steps=9)})
    record = msgspec.structs.replace(record, beat=beat)
    write_holder(holder_path(folder, record.token), record)
    make_claim(ClaimFile(folder, key, number), record.token)
    return record


def test_one_holder_at_a_time(tmp_path: Path) -> None:
    one, other = make(tmp_path), make(tmp_path)
    one.take(KEY)
    with pytest.raises(ClipClaimed, match="This program trains this clip") as refused:
        other.take(KEY)
    assert refused.value.is_sure, "a living process of this computer"
    other.take("0004")
    one.release(KEY)
    other.take(KEY)
    other.close()
    assert list((tmp_path / CLAIMS).iterdir()) == []


def test_one_that_falls_silent_is_dead_after_a_minute_of_the_watchers_own_clock(tmp_path: Path) -> None:
    clock = Clock()
    claims, record = make(tmp_path, clock), far_away(tmp_path)
    os.utime(holder_path(tmp_path, record.token), (4e9, 4e9))  # its clock is decades ahead
    with pytest.raises(ClipClaimed, match="computer render-7") as refused:
        claims.take(KEY)
    assert not refused.value.is_sure
    watch(claims, clock, DEAD_AFTER_S - 1)
    far_away(tmp_path, beat=2)  # it lives
    with pytest.raises(ClipClaimed) as refused:
        claims.take(KEY)
    assert refused.value.is_sure
    for _ in range(int(DEAD_AFTER_S) - 1):
        clock.now_s += 1
        with pytest.raises(ClipClaimed):
            claims.take(KEY)
    clock.now_s += 1
    claims.take(KEY)
    assert list_claims(tmp_path)[KEY].number == 2
    claims.release(KEY)
    assert list_claims(tmp_path) == {}, "with the claims that count less"


def test_one_that_was_taken_for_dead_finds_its_claim_lost(tmp_path: Path) -> None:
    clock = Clock()
    slow, other = make(tmp_path), make(tmp_path, clock)
    slow.take(KEY)
    look_dead(tmp_path, slow)
    take_over(other, clock)
    assert not slow.is_lost(KEY)
    with pytest.raises(ClipClaimed, match="had said nothing"):
        slow.check(KEY)
    slow.look()
    assert slow.is_lost(KEY)
    slow.release(KEY)
    other.check(KEY)  # raises nothing: it was not the slow one's to remove


def test_a_process_of_this_computer_that_has_ended_is_dead_at_once(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    child = context.Process(target=_claim_and_die, args=(str(tmp_path),))
    child.start()
    child.join(300)
    assert child.exitcode == 9
    assert list(list_claims(tmp_path)) == [KEY]
    assert live_claims(tmp_path) == {}
    claims = make(tmp_path)
    claims.take(KEY)
    assert list_claims(tmp_path)[KEY].number == 2
    claims.close()
    sweep_claims(tmp_path)
    assert list((tmp_path / CLAIMS).iterdir()) == []


def _claim_and_die(folder: str) -> None:
    Claims(Path(folder), has_thread=False).take(KEY)
    os._exit(9)


def test_of_many_at_once_one_gets_it(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    with context.Pool(4) as pool:
        won = pool.starmap(_try_often, [(str(tmp_path), number) for number in range(4)])
    taken = sorted(key for keys in won for key in keys)
    assert taken == [f"{number:04d}" for number in range(200)], "each once"


def _try_often(folder: str, number: int) -> list[str]:
    claims, won = Claims(Path(folder), has_thread=False), []
    for key in (f"{index:04d}" for index in range(200)):
        try:
            claims.take(key)
            won.append(key)
        except ClipClaimed:
            continue
    return won


def test_containers_of_one_computer_do_not_count_each_others_processes(tmp_path: Path) -> None:
    (tmp_path / CLAIMS).mkdir()
    record = HolderRecord("e" * 32, replace(this_process(), pid=2**22 - 3, start=""), space="pid:[1]")
    write_holder(holder_path(tmp_path, record.token), record)
    make_claim(ClaimFile(tmp_path, KEY, 1), record.token)
    assert KEY in live_claims(tmp_path), "no process of this number here says nothing"
    with pytest.raises(ClipClaimed):
        make(tmp_path).take(KEY)
    assert pid_space() != "pid:[1]"


def test_a_clip_that_was_cut_otherwise_is_named_by_its_frames(tmp_path: Path) -> None:
    make(tmp_path).take("000030-000035")
    with pytest.raises(ProjectError, match="trains the clip of frames 30 to 34 of this project"):
        check_unclaimed(tmp_path)


def test_what_others_train_is_seen_and_they_can_be_asked(tmp_path: Path) -> None:
    far_away(tmp_path)
    claims, other = make(tmp_path), make(tmp_path)
    claims.look()
    assert claims.elsewhere[KEY].progress == ClipProgress(3, "running", "render-7", step=5, n_steps=9)
    assert [holder.owner.host for holder in claims.others] == ["render-7"]
    with pytest.raises(ProjectError, match=r"computer render-7 .* trains clip 3"):
        check_unclaimed(tmp_path)
    other.take("0004")
    ask_holder(tmp_path, "0004", "pause")
    ask_holder(tmp_path, KEY, "stop")
    (tmp_path / CLAIMS / "ask-0004x.json").write_text("{}")
    other.look()
    assert other.take_asked() == [("0004", "pause")]
    assert other.take_asked() == []
    (tmp_path / CLAIMS / "ask-0004.json").write_text(json.dumps({"do": "format the disk"}))
    other.look()
    assert other.take_asked() == []


def test_what_is_released_while_others_are_looked_at_is_not_taken_for_anothers(tmp_path: Path, monkeypatch) -> None:
    claims = make(tmp_path)
    claims.take(KEY)
    claims.take("0004")

    def listed_then_released(folder: Path) -> dict[str, ClaimFile]:
        found = list_claims(folder)
        claims.release(KEY)
        return found

    monkeypatch.setattr("app.project.claims.claims.list_claims", listed_then_released)
    claims.look()
    assert claims.elsewhere == {}


def test_clips_that_others_finish_are_noticed(tmp_path: Path) -> None:
    (tmp_path / CLAIMS).mkdir()
    (tmp_path / "clips").mkdir()
    claims = make(tmp_path)
    claims.look()
    assert claims.take_changed() == set()
    (tmp_path / "clips" / "0003.safetensors").write_bytes(b"new")
    claims.look()
    assert claims.take_changed() == {KEY}


def test_a_clip_that_replaces_another_of_the_same_size_is_noticed(tmp_path: Path) -> None:
    (tmp_path / CLAIMS).mkdir()
    (tmp_path / "clips").mkdir()
    path = tmp_path / "clips" / f"{KEY}.safetensors"
    path.write_bytes(b"old")
    claims = make(tmp_path)
    claims.look()
    (tmp_path / "new").write_bytes(b"new")
    os.replace(tmp_path / "new", path)
    claims.look()
    assert claims.take_changed() == {KEY}


def test_who_only_trains_looks_at_files_of_its_own_clips_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    claims = make(tmp_path, clock)
    claims.take(KEY)
    for index in range(4, 300):
        make_claim(ClaimFile(tmp_path, f"{index:04d}", 1), "f" * 32)
    ask_holder(tmp_path, KEY, "pause")
    with monkeypatch.context() as patched:
        for name in ("listdir", "scandir"):
            patched.setattr(f"os.{name}", lambda *_: pytest.fail("hundreds that list each other keep a disk busy"))
        clock.now_s += 10.0
        before = read_holder(holder_path(tmp_path, claims.token))
        claims.look_after_held()
        after = read_holder(holder_path(tmp_path, claims.token))
    assert before is not None
    assert after is not None
    assert after.beat == before.beat + 1
    assert claims.take_asked() == [(KEY, "pause")]
    assert not claims.is_lost(KEY)
    make_claim(ClaimFile(tmp_path, KEY, 2), "e" * 32)
    claims.look_after_held()
    assert claims.is_lost(KEY)


@pytest.mark.parametrize("content", [b"", b"\xff\xfe", b"x" * 5000, b"{}"])
def test_damaged_claims_are_claims_until_a_minute_has_passed(tmp_path: Path, content: bytes) -> None:
    (tmp_path / CLAIMS).mkdir()
    (tmp_path / CLAIMS / f"{KEY}.0001").write_bytes(content)
    (tmp_path / CLAIMS / "holder-xyz.json").write_bytes(content)
    (tmp_path / CLAIMS / f"{KEY}.x").write_bytes(content)
    clock = Clock()
    claims = make(tmp_path, clock)
    with pytest.raises(ClipClaimed, match="Another program"):
        claims.take(KEY)
    take_over(claims, clock)


def test_a_claim_whose_file_somebody_removed_is_made_again(tmp_path: Path) -> None:
    claims = make(tmp_path)
    claims.take(KEY)
    list_claims(tmp_path)[KEY].path.unlink()
    claims.look()
    assert not claims.is_lost(KEY)
    assert KEY in list_claims(tmp_path)


def test_a_disk_that_refuses_is_an_error_that_leaves_nothing_claimed(tmp_path: Path, monkeypatch) -> None:
    claims = make(tmp_path)
    claims.take("0001")

    def refuse(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("app.project.claims.claims.write_holder", refuse)
    before = holder_path(tmp_path, claims.token).stat().st_mtime_ns
    with pytest.raises(DiskError, match="No space left"):
        claims.take(KEY)
    assert holder_path(tmp_path, claims.token).stat().st_mtime_ns >= before, "a full disk makes nobody look dead"
    assert list(list_claims(tmp_path)) == ["0001"]


def test_one_that_was_halted_gives_up_a_clip_that_was_taken_over_and_released_since(tmp_path: Path) -> None:
    """Its own number is free again then, or has been given to a third one."""
    for has_third in (False, True):
        own, clock = Clock(), Clock()
        halted, other, third = make(tmp_path, own), make(tmp_path, clock), make(tmp_path)
        halted.take(KEY)
        look_dead(tmp_path, halted)
        take_over(other, clock)
        other.release(KEY)
        if has_third:
            third.take(KEY)
        own.now_s = 2 * DEAD_AFTER_S
        halted.look()
        assert halted.is_lost(KEY)
        halted.close()
        assert list(list_claims(tmp_path)) == [KEY] * has_third, "what is not its own stays"
        third.close()


def test_a_process_that_was_halted_itself_takes_nobody_for_dead(tmp_path: Path) -> None:
    """Or a disk of the network that did not answer for minutes: then nobody could have said anything."""
    clock = Clock()
    claims = make(tmp_path, clock)
    far_away(tmp_path)
    claims.look()
    clock.now_s = 100 * DEAD_AFTER_S
    claims.look()
    assert KEY in claims.elsewhere
    with pytest.raises(ClipClaimed):
        claims.take(KEY)


def test_who_watches_removes_claims_and_records_of_the_dead(tmp_path: Path) -> None:
    clock = Clock()
    claims = make(tmp_path, clock)
    far_away(tmp_path)
    idle = holder_path(tmp_path, "d" * 32)
    idle.write_text("{}")
    (tmp_path / CLAIMS / "notes.txt").write_text("mine")
    watch(claims, clock, DEAD_AFTER_S)
    assert list_claims(tmp_path) != {}
    watch(claims, clock, 2 * DEAD_AFTER_S)
    assert [path.name for path in (tmp_path / CLAIMS).iterdir()] == ["notes.txt"]


def test_two_computers_of_one_image_are_two(tmp_path: Path) -> None:
    """The same name and the same id, which only the number of their start tells apart."""
    if not boot_id():
        pytest.skip("starts are not numbered here")
    (tmp_path / CLAIMS).mkdir()
    record = HolderRecord("e" * 32, replace(this_process(), pid=2**22 - 3, start="", boot="another"), space=pid_space())
    write_holder(holder_path(tmp_path, record.token), record)
    make_claim(ClaimFile(tmp_path, KEY, 1), record.token)
    assert KEY in live_claims(tmp_path)


def test_a_claim_that_a_listing_does_not_show_yet_is_another_ones(tmp_path: Path, monkeypatch) -> None:
    """As computers of a network list a folder that they have listed a moment ago."""
    far_away(tmp_path)
    monkeypatch.setattr("app.project.claims.claims.newest_claim", lambda *_: None)
    with pytest.raises(ClipClaimed, match="computer render-7"):
        make(tmp_path).take(KEY)


def test_records_of_a_newer_program_are_read(tmp_path: Path) -> None:
    record = far_away(tmp_path)
    path = holder_path(tmp_path, record.token)
    written = json.loads(path.read_text())
    written |= {"schema": 9, "colour": "blue"}
    written["clips"][KEY]["mood"] = {"good": True}
    path.write_text(json.dumps(written))
    claims = make(tmp_path)
    claims.look()
    assert claims.elsewhere[KEY].progress == record.clips[KEY]


def test_a_disk_that_is_full_when_the_claim_is_closed_leaves_no_claim(tmp_path: Path, monkeypatch) -> None:
    """Disks of the network say only then that they are full."""
    (tmp_path / CLAIMS).mkdir()
    close = os.close

    def refuse(descriptor: int) -> None:
        close(descriptor)
        raise OSError(122, "Disk quota exceeded")

    monkeypatch.setattr("app.project.claims.claim_files.os.close", refuse)
    with pytest.raises(OSError, match="quota"):
        make_claim(ClaimFile(tmp_path, KEY, 1), "a" * 32)
    assert list_claims(tmp_path) == {}


def test_a_worker_puts_nothing_into_a_clip_that_another_process_has_taken_over(tmp_path: Path) -> None:
    record = far_away(tmp_path)
    check_claim(tmp_path, KEY, record.token)
    check_claim(tmp_path, KEY, "")
    check_claim(tmp_path, "0004", "a" * 32)
    make_claim(ClaimFile(tmp_path, KEY, 2), "a" * 32)
    with pytest.raises(ClipClaimed, match="Another program trains this clip"):
        check_claim(tmp_path, KEY, record.token)


def test_a_disk_that_cannot_be_written_is_named_as_the_cause(tmp_path: Path, monkeypatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr("app.project.claims.claims.write_holder", refuse)
    with pytest.raises(DiskError, match="Read-only file system"):
        make(tmp_path).take(KEY)


def test_who_loses_every_race_for_a_clip_leaves_it_to_the_others(tmp_path: Path, monkeypatch) -> None:
    """Else a queue would try for ever to start it."""
    claims = make(tmp_path)
    monkeypatch.setattr("app.project.claims.claims.make_claim", lambda *_: False)
    with pytest.raises(ClipClaimed, match="again and again"):
        claims.take(KEY)
    assert KEY in claims.elsewhere


def test_a_disk_that_does_not_answer_a_look_keeps_nobody_waiting(tmp_path: Path, monkeypatch) -> None:
    """Those who claim, release and close are the window's thread."""
    (tmp_path / "clips").mkdir()
    claims, may_answer, is_asked = Claims(tmp_path), threading.Event(), threading.Event()
    scandir = os.scandir

    def slow(folder: Path) -> object:
        is_asked.set()
        assert may_answer.wait(60)
        return scandir(folder)

    monkeypatch.setattr("app.project.claims.claims.os.scandir", slow)
    claims.watch()
    assert is_asked.wait(60)
    claims.take(KEY)
    claims.release(KEY)
    claims.close()
    assert not may_answer.is_set()
    thread = claims._thread
    assert thread is not None
    may_answer.set()
    thread.join(60)
    assert not thread.is_alive()


def test_a_thread_that_ends_while_a_clip_is_claimed_is_followed_by_another(tmp_path: Path, monkeypatch) -> None:
    claims = Claims(tmp_path)
    ends, is_needed = threading.Event(), claims._is_needed

    def seen() -> bool:
        found = is_needed()
        if not found and not ends.is_set():
            claims.take(KEY)  # before the thread is gone
            ends.set()
        return found

    monkeypatch.setattr(claims, "_is_needed", seen)
    claims.watch()
    first = claims._thread
    claims.close()
    assert ends.wait(60)
    assert claims._thread not in (None, first)
    claims.close()
