"""Puts the frames of two captures of the Panoptic layout one after the other, so that clips lie far from each other.

    python -m tests.benchmarks.join_panoptic FIRST SECOND OUT [--frames 20]

Takes so many frames from the beginning of each. OUT gets copies of the pictures, and metadata of its own.
"""

from __future__ import annotations

import argparse
import json
import shutil
from pathlib import Path
from typing import Any

META = ("train_meta.json", "test_meta.json")
PER_FRAME = ("k", "w2c", "fn", "cam_id")


def main() -> None:
    """Command line; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", type=Path)
    parser.add_argument("second", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--frames", type=int, default=20)
    options = parser.parse_args()
    for name in META:
        joined: dict[str, Any] = {}
        for part, folder in enumerate((options.first, options.second)):
            meta = json.loads((folder / name).read_text("utf-8"))
            for key in PER_FRAME:
                chosen = meta[key][: options.frames]
                if key == "fn":
                    chosen = [[_copied(folder, file, options.out, part) for file in row] for row in chosen]
                joined.setdefault(key, []).extend(chosen)
            joined |= {key: value for key, value in meta.items() if key not in PER_FRAME}
        (options.out / name).write_text(json.dumps(joined), "utf-8")


def _copied(folder: Path, file: str, out: Path, part: int) -> str:
    """Copy a picture under a name by which the second capture's come after the first one's; its path in the layout."""
    camera, name = file.split("/")
    new = f"{camera}/{part}{name}"
    (out / "ims" / camera).mkdir(parents=True, exist_ok=True)
    shutil.copyfile(folder / "ims" / file, out / "ims" / new)
    return new


if __name__ == "__main__":
    main()
