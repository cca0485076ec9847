"""How long the document of a project takes: keeping a step, writing project.json anew, opening.

python -m tests.benchmarks.bench_document
"""

from __future__ import annotations

import random
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from msgspec import structs

from app.document.history import Changed, DocumentHistory, Undone
from app.document.project_document import ProjectDocument
from app.document.storing.document_store import DocumentStore
from tests.app.document.documents import EMPTY, picked_edit, random_events

N_STEPS, N_EDITS, N_PICKS = 500, 1000, 50_000


def timed(act: Callable[[], object]) -> float:
    """Milliseconds that something takes."""
    started_s = time.perf_counter()
    act()
    return 1e3 * (time.perf_counter() - started_s)


def small(folder: Path) -> None:
    """500 steps of a document as people make them."""
    store = DocumentStore(folder)
    store.create(EMPTY)
    times = []
    for event, history in random_events(random.Random(1), N_STEPS):
        times.append(timed(lambda event=event, history=history: store.write([event], history)))
    print(f"keep a step: median {statistics.median(times):.1f} ms, slowest {max(times):.0f} ms")
    print(f"open with {N_STEPS} steps, some of them in the journal: {timed(DocumentStore(folder).read):.0f} ms")
    print(f"write project.json anew: {timed(store.compact):.0f} ms")
    print(f"open after that: {timed(DocumentStore(folder).read):.0f} ms")


def large(folder: Path) -> None:
    """1,000 edits of 50,000 picks each."""
    rng = random.Random(2)
    distinct = [picked_edit(i, N_PICKS, rng) for i in range(20)]
    edits = tuple(structs.replace(distinct[i % 20], edit_id=i) for i in range(N_EDITS))
    document = replace(EMPTY, edits=edits)
    store = DocumentStore(folder)
    print(f"write {N_EDITS} edits of {N_PICKS} picks: {timed(lambda: store.create(document)):.0f} ms", end=", ")
    print(f"{(folder / 'project.json').stat().st_size / 1e6:.0f} MB")
    history = DocumentHistory(document)
    times, undos = [], []
    for i in range(100):
        changed: ProjectDocument = replace(
            history.present, edits=(*edits[:i], structs.replace(edits[i], is_on=False), *edits[i + 1 :])
        )
        event = Changed("switch an edit off", changed)
        history = history.after(event)
        times.append(timed(lambda event=event, history=history: store.write([event], history)))
        undone = history.after(Undone())
        undos.append(timed(lambda undone=undone: store.write([Undone()], undone)))
        history = undone
    print(f"switch one of them off: median {statistics.median(times):.1f} ms, slowest {max(times):.0f} ms")
    print(f"undo: median {statistics.median(undos):.1f} ms")
    print(f"open with {len(times) + len(undos)} steps: {timed(DocumentStore(folder).read):.0f} ms")


def main() -> int:
    """Print all of it."""
    for measure in (small, large):
        with tempfile.TemporaryDirectory() as folder:
            measure(Path(folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
