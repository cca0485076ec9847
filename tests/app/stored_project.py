"""A small real training that lies in the repository."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from engine.assets import asset_path

STORED = Path(__file__).parents[1] / "data" / "stored_project"


def copy_stored(folder: Path) -> Path:
    """A copy of the training of the sample's first two clips, frames 0 to 5 of 30, 80 x 60 pixels."""
    shutil.copytree(STORED, folder)
    content = json.loads((folder / "project.json").read_text())
    (folder / "project.json").write_text(json.dumps(content | {"capture": str(asset_path("sample"))}))
    return folder
