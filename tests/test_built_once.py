"""What is built once is handed out whole, and built anew where anything that it depends on has changed."""

from pathlib import Path

import pytest
from filelock import FileLock

from tests import built_once
from tests.built_once import BuiltOnce


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A source tree of two files."""
    root = tmp_path / "tree"
    (root / "engine").mkdir(parents=True)
    (root / "engine" / "a.py").write_text("a = 1")
    (root / "recipe.py").write_text("b = 1")
    monkeypatch.setattr(built_once, "ROOT", root)
    monkeypatch.setattr(built_once, "ALWAYS", ("engine",))
    return root


@pytest.fixture
def store_root(tmp_path: Path) -> Path:
    """An empty folder."""
    folder = tmp_path / "store"
    folder.mkdir()
    return folder


class Builder:
    """Counts how often it was asked."""

    def __init__(self) -> None:
        self.n_built = 0

    def __call__(self, folder: Path) -> None:
        self.n_built += 1
        (folder / "inner").mkdir()
        (folder / "inner" / "clip").write_bytes(b"learned")


def copies(store: BuiltOnce, folder: Path, build: Builder, n: int) -> list[bytes]:
    """What n copies hold."""
    start = len(list(folder.glob("copy-*")))
    made = [store.copy("clip", folder / f"copy-{start + i}", build, sources=["recipe.py"]) for i in range(n)]
    return [(path / "inner" / "clip").read_bytes() for path in made]


def test_it_is_built_once_and_every_copy_is_the_callers_own(tree, store_root, tmp_path):
    store, build = BuiltOnce(store_root), Builder()
    assert copies(store, tmp_path, build, 2) == [b"learned"] * 2
    (tmp_path / "copy-0" / "inner" / "clip").write_bytes(b"spoiled by a test")
    assert copies(BuiltOnce(store_root), tmp_path, build, 1) == [b"learned"]
    assert build.n_built == 1
    assert {path.name for path in (tmp_path / "copy-0").iterdir()} == {"inner"}


@pytest.mark.parametrize("changed", ["engine/a.py", "engine/new.py", "recipe.py"])
def test_a_changed_source_builds_anew(tree, store_root, tmp_path, changed):
    store, build = BuiltOnce(store_root), Builder()
    copies(store, tmp_path, build, 1)
    (tree / changed).write_text("changed")
    copies(store, tmp_path, build, 2)
    assert build.n_built == 2


@pytest.mark.parametrize("is_gone", [True, False])
def test_what_was_damaged_is_built_anew(tree, store_root, tmp_path, is_gone):
    store, build = BuiltOnce(store_root), Builder()
    copies(store, tmp_path, build, 1)
    (kept,) = (path for path in store_root.glob("clip-*/inner/clip"))
    if is_gone:
        kept.unlink()
    else:
        kept.write_bytes(b"LEARNED")
    assert copies(store, tmp_path, build, 1) == [b"learned"]
    assert build.n_built == 2


def test_a_build_that_fails_keeps_nothing(tree, store_root, tmp_path):
    def fail(folder: Path) -> None:
        (folder / "half").touch()
        raise RuntimeError("no luck")

    store, build = BuiltOnce(store_root), Builder()
    with pytest.raises(RuntimeError, match="no luck"):
        store.copy("clip", tmp_path / "failed", fail, sources=["recipe.py"])
    assert copies(store, tmp_path, build, 1) == [b"learned"]
    assert not list(store_root.rglob("half"))


def test_the_oldest_go(tree, store_root, tmp_path):
    store, build = BuiltOnce(store_root, max_folders=2), Builder()
    for i in range(4):
        (tree / "recipe.py").write_text(str(i))
        copies(store, tmp_path, build, 1)
    assert len(list(store_root.glob("clip-*"))) == 2


def test_what_another_worker_uses_stays(tree, store_root, tmp_path):
    store, build = BuiltOnce(store_root, max_folders=1), Builder()
    store.copy("other", tmp_path / "other", build)
    with FileLock(store_root / "other.lock"):  # as it copies
        copies(store, tmp_path, build, 1)
        assert list(store_root.glob("other-*"))
    (tree / "recipe.py").write_text("changed")
    copies(store, tmp_path, build, 1)
    assert len([path for path in store_root.iterdir() if path.is_dir()]) == 1


def test_without_a_place_everything_is_built(tree, tmp_path):
    build = Builder()
    assert copies(BuiltOnce(None), tmp_path, build, 2) == [b"learned"] * 2
    assert build.n_built == 2


def test_a_source_that_is_not_there_is_a_mistake(tree, store_root, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nowhere\.py"):
        BuiltOnce(store_root).copy("clip", tmp_path / "copy", Builder(), sources=["nowhere.py"])
