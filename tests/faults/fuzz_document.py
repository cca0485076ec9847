"""Damaged documents and journals: a message, or exactly a state that the document once had, with what is lost named.

Each case damages one file of the document of a project: project.json, its backup, history.json, or one of two files of
the journal; its bytes, a value of its JSON, or what lies under its name. Then the project is read. Counted as faults:
an exception that is not an EngineError, a hang, a document that never was, and a loss that nothing is said about. What
can be read has to go on: another step is taken, and read again. What cannot is repaired, which has to give a state
that the document once had, with nothing left to complain about.

    python -m tests.faults.fuzz_document --cases 2000 --seed 1
"""

from __future__ import annotations

import logging
import random
import shutil
import sys
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.faults.mutate import damaged_bytes, damaged_json, put_odd_file
from tests.faults.tally import Case, Outcome, fuzz_main, judge, start_memory, take_outside, watch_files

N_EVENTS = (40, 30, 12)
"""Before the first compaction, between it and the second, and after that."""
FILES = ("project.json", "journal/00000070.jsonl", "journal/00000040.jsonl", "history.json", "project.backup.json")
WEIGHTS = (5, 8, 2, 4, 1)
_states: set[bytes] = set()
"""Documents that there were, of this process."""
_steps: list[tuple[bytes, ...]] = []
"""The last document, and the way back and forth from it."""


def make_document(folder: Path) -> None:
    """A project with some history, as it is after a kill."""
    from app.document.history import DocumentHistory, Redone, Undone
    from app.document.storing.document_store import DocumentStore
    from tests.app.document.documents import EMPTY, as_bytes, random_events

    store = DocumentStore(folder)
    store.create(EMPTY)
    history = DocumentHistory(EMPTY)
    _states.add(as_bytes(EMPTY))
    compactions = {N_EVENTS[0], N_EVENTS[0] + N_EVENTS[1]}
    for number, (event, history) in enumerate(random_events(random.Random(11), sum(N_EVENTS)), start=1):
        store.write([event], history)
        _states.add(as_bytes(history.present))
        if number in compactions:
            store.compact()
    for event in (*[Undone()] * 15, *[Redone()] * 4):  # beyond the project.json of now
        history = history.after(event)
        store.write([event], history)
        _states.add(as_bytes(history.present))
    _steps[:] = [steps_of(history)]


def steps_of(history: Any) -> tuple[bytes, ...]:
    """A history as bytes: the document, then all others with the names of the steps."""
    from tests.app.document.documents import as_bytes

    others = [step.name.encode() + as_bytes(step.document) for step in (*history.past, *history.future)]
    return as_bytes(history.present), *others


def damage(path: Path, rng: random.Random) -> str:
    """Damage a file. Returns how."""
    kind = rng.choice(("bytes", "bytes", "bytes", "value", "value", "lines", "odd file"))
    if kind == "odd file":
        return put_odd_file(path, rng)
    data = path.read_bytes()
    lines = data.splitlines(keepends=True)
    if kind == "bytes" or (kind == "lines" and path.suffix != ".jsonl"):
        what, data = damaged_bytes(data, rng)
    elif path.suffix != ".jsonl":
        what, data = damaged_json(data, rng)
    else:
        index = rng.randrange(len(lines))
        if kind == "value":
            what, line = damaged_json(lines[index], rng)
            lines[index] = line + b"\n"
        else:
            what = rng.choice(("line gone", "line twice", "lines swapped", "end gone"))
            other = rng.randrange(len(lines))
            match what:
                case "line gone":
                    del lines[index]
                case "line twice":
                    lines.insert(other, lines[index])
                case "lines swapped":
                    lines[index], lines[other] = lines[other], lines[index]
                case _:
                    del lines[index:]
        data = b"".join(lines)
    path.write_bytes(data)
    return f"{kind}, {what}"


def run_case(case: Case) -> Outcome:
    """Damage a file as index and seed say, and read the project."""
    rng = random.Random(zlib.crc32(f"{case.seed}:{case.index}".encode()))
    pristine = case.work_dir / "pristine"
    if not pristine.is_dir():
        logging.getLogger("app.document").setLevel(logging.ERROR)
        pristine.mkdir()
        make_document(pristine)
        watch_files([case.work_dir])
        start_memory()
    name = rng.choices(FILES, WEIGHTS)[0]
    project = case.work_dir / "case"
    shutil.rmtree(project, ignore_errors=True)
    shutil.copytree(pristine, project)
    n_bytes = (project / name).stat().st_size
    what = damage(project / name, rng)
    take_outside()
    problem: list[str] = []
    verdict, detail = judge(lambda: problem.append(_read(project)))
    if verdict == "typed":
        repair_verdict, repair_detail = judge(lambda: problem.append(_repair(project)))
        if repair_verdict == "untyped":
            verdict, detail = "untyped", f"repair: {repair_detail}"
    if verdict in ("typed", "accepted") and any(problem):
        verdict, detail = "changed", "; ".join(problem)
    outside = take_outside()
    if outside:
        verdict, detail = "outside", ", ".join(outside)
    shutil.rmtree(project)
    return Outcome(f"{name}: {what}", verdict, detail, n_bytes)


def _read(project: Path) -> str:
    """Read a project and go on with it. What is wrong; raises EngineError where the damage is named."""
    from app.document.storing.document_store import DocumentStore

    store = DocumentStore(project)
    history = store.read()
    found = steps_of(history)
    if found[0] not in _states:
        return "a document that never was"
    if found != _steps[0] and not store.notes:
        return "a loss that nothing was said about"
    return _gone_on(store, history)


def _repair(project: Path) -> str:
    """Repair a project and go on with it. What is wrong; raises EngineError where nothing can be kept."""
    from app.document.storing.document_store import DocumentStore
    from app.document.storing.recovery import look_for_recovery, recover

    known = look_for_recovery(project)
    if known is None:
        return "nothing to repair in a project that does not open"
    aside = recover(project)
    store = DocumentStore(project)
    history = store.read()
    if steps_of(history)[0] not in _states:
        return "a document that never was, after repairing"
    if store.notes or store.n_replayed:
        return f"after repairing: {store.notes}"
    if not any(aside.iterdir()):
        return "nothing was kept aside"
    return _gone_on(store, history)


def _gone_on(store: Any, history: Any) -> str:
    """Take another step and read everything again. What is wrong."""
    from app.document.history import Changed
    from app.document.project_document import Marker
    from app.document.storing.document_store import DocumentStore

    change = Changed("go on", replace(history.present, markers=(Marker(99, "on"),)))
    after = history.after(change)
    store.write([change], after)
    again = DocumentStore(store.folder)
    if steps_of(again.read())[0] != steps_of(after)[0]:
        return "the next step is not there"
    return ""


if __name__ == "__main__":
    sys.exit(fuzz_main("fuzz_document", __doc__ or "", run_case, n_cases=2000))
