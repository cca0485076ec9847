"""Trains on disks of different sizes that fill up: training goes on, or stops with what it learned, and says why.

python -m tests.faults.full_disk --sizes 20

Each size is a tmpfs of its own, so it needs root and Linux. After the first run has ended, the disk is made larger and
the same command has to finish with the same bits as a training that had room from the start.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from tests.faults.trainings import FAST, SETTINGS, Command, Kept, kept_clips, leftovers, problems_of

LONGEST_RUN_S = 600.0
ROOM_KB = 64_000
SMALLEST_KB, LARGEST_KB = 24, 6_000
"""A project of two toy clips takes up to about 3 MB while it is trained."""


@dataclass
class Tally:
    """What was done and what was wrong."""

    endings: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    def line(self) -> str:
        """All of it in one line."""
        endings = ", ".join(f"{n} {ending}" for ending, n in sorted(self.endings.items()))
        return f"{sum(self.endings.values())} sizes of disk ({endings}): {len(self.faults)} faults"


def can_mount() -> bool:
    """Whether this process may mount file systems."""
    try:
        with tempfile.TemporaryDirectory() as folder, full_disk(Path(folder), 100):
            return True
    except (OSError, subprocess.CalledProcessError):
        return False


@contextmanager
def full_disk(folder: Path, size_kb: int) -> Iterator[Path]:
    """A disk of that size, mounted on a folder."""
    subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size_kb}k", "tmpfs", str(folder)], check=True, capture_output=True
    )
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=False, capture_output=True)


def sizes_kb(n: int) -> list[int]:
    """Sizes that lie evenly by their ratio."""
    ratio = LARGEST_KB / SMALLEST_KB
    return [round(SMALLEST_KB * ratio ** (i / max(n - 1, 1))) for i in range(n)]


def fill(
    work: Path, sizes: Sequence[int], *, settings: tuple[str, ...], clips: str, expected: dict[int, Kept]
) -> Tally:
    """Train on a disk of every size, then with room.

    Args:
        work: An empty folder.
        settings, clips: Arguments of the training.
        expected: The clips of a training that had room.
    """
    tally = Tally()
    for size_kb in sizes:
        disk, scratch = work / f"disk-{size_kb}", work / f"scratch-{size_kb}"
        disk.mkdir()
        scratch.mkdir()
        with full_disk(disk, size_kb):
            project = disk / "project"
            ending = _run(project, scratch, settings, clips, tally, f"{size_kb} kB")
            tally.endings[ending] += 1
            found = [*problems_of(project), *(f"left over: {path}" for path in project.rglob(".partial-*"))]
            if not found:
                found = _differences(kept_clips(project), expected)
            subprocess.run(["mount", "-o", f"remount,size={ROOM_KB}k", str(disk)], check=True, capture_output=True)
            if _run(project, scratch, settings, clips, tally, f"{size_kb} kB, then room") != "trained":
                found.append("not finished with room")
            elif set(clips_with_room := kept_clips(project)) != set(expected):
                found.append(f"clips {sorted(clips_with_room)} with room, not {sorted(expected)}")
            else:
                found += _differences(clips_with_room, expected)
            found += [f"left over: {path}" for path in leftovers(project, scratch)]
            tally.faults += [f"{size_kb} kB: {problem}" for problem in found]
        print(f"{size_kb} kB: {ending}", flush=True)
    return tally


def _run(project: Path, scratch: Path, settings: tuple[str, ...], clips: str, tally: Tally, where: str) -> str:
    """One run to its end. Says how it ended."""
    command = Command(project, scratch, settings, clips, every_s=1.0)
    if not command.wait(LONGEST_RUN_S):
        command.kill_group()
        tally.faults.append(f"{where}: not finished after {LONGEST_RUN_S:.0f} s")
        return "hang"
    code, said = command.process.returncode, command.said()
    for word in ("Traceback", "bug in the program", "Logging error"):
        if word in said:
            tally.faults.append(f"{where}: {word}: {said[-1500:]}")
    if code == 0:
        return "trained"
    if code != 1 or "No space left on device" not in said:
        tally.faults.append(f"{where}: exit code {code}: {said[-800:]}")
    if not (project / "project.json").exists():
        return "no project made"
    return "stopped, learned steps kept" if "is kept" in said or list(project.glob("c*/*.safetensors")) else "stopped"


def _differences(clips: dict[int, Kept], expected: dict[int, Kept]) -> list[str]:
    return [f"clip {index} differs" for index, kept in clips.items() if kept != expected.get(index)]


def main() -> int:
    """The command line of this script. Returns the exit code: 1 where there was a fault."""
    parser = argparse.ArgumentParser(description="Train on disks that fill up.")
    parser.add_argument("--sizes", type=int, default=20)
    parser.add_argument("--only", type=int, nargs=2, metavar=("A", "B"), help="sizes A up to B of these")
    parser.add_argument("--clips", default="0:2", help='as "0:2"; "0" trains clip 0 with --clip')
    parser.add_argument("--fast", action="store_true", help="so few steps that a clip takes seconds")
    parser.add_argument("--reference", type=Path, help="project trained with the same settings and room")
    options = parser.parse_args()
    if not can_mount():
        print("Skipped: this needs root, to mount disks of chosen sizes.")
        return 0
    settings = FAST if options.fast else SETTINGS
    sizes = sizes_kb(options.sizes)[slice(*(options.only or (None,)))]
    with tempfile.TemporaryDirectory(prefix="full-disk-") as folder:
        work = Path(folder)
        first, _, end = options.clips.partition(":")
        reference = options.reference
        if reference is None:
            reference, scratch = work / "reference", work / "scratch"
            scratch.mkdir()
            command = Command(reference, scratch, settings, options.clips, every_s=None)
            command.wait(LONGEST_RUN_S)
        last = int(end or int(first) + 1)
        expected = {index: kept for index, kept in kept_clips(reference).items() if int(first) <= index < last}
        tally = fill(work, sizes, settings=settings, clips=options.clips, expected=expected)
    for fault in tally.faults:
        print("FAULT", fault)
    print(tally.line())
    return 1 if tally.faults else 0


if __name__ == "__main__":
    sys.exit(main())
