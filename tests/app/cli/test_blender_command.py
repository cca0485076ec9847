"""clipgstream blender: where the add-on lies, and what is said when it cannot."""

from __future__ import annotations

from pathlib import Path
from zipfile import is_zipfile


def test_it_writes_the_add_on_and_says_where(run, tmp_path: Path):
    code, out, _ = run("blender", "--out", tmp_path / "new")
    assert code == 0
    path = Path(out.splitlines()[0])
    assert path == tmp_path / "new" / "clipgstream_blender.zip"
    assert is_zipfile(path)
    assert "Install from Disk" in out
    code, _, said = run("blender", "--out", path)
    assert code != 0
    assert "The add-on could not be written" in said
    assert "Traceback" not in said
