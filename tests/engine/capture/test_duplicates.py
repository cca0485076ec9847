"""Cameras with the same pictures are found without reading all of them."""

from pathlib import Path

from engine.capture.files.duplicates import SAMPLE_BYTES, CameraFiles, check_duplicates


def camera(folder: Path, name: str, *contents: bytes) -> CameraFiles:
    """Files of one camera."""
    paths = [folder / f"{name}-{i}" for i in range(len(contents))]
    for path, content in zip(paths, contents, strict=True):
        path.write_bytes(content)
    return CameraFiles(paths, [len(content) for content in contents])


def test_copies_are_told_once_for_each_group(tmp_path):
    cameras = {name: camera(tmp_path, name, b"same", b"pictures") for name in "abc"}
    cameras |= {"d": camera(tmp_path, "d", b"diff", b"erent!!!"), "e": camera(tmp_path, "e", b"longer", b"pictures")}
    (problem,) = check_duplicates(cameras)
    assert 'Cameras "a" and "b" and 1 more show the same pictures: a-0 and b-0' in problem.message


def test_files_that_differ_at_their_ends_alone_are_different(tmp_path):
    middle = bytes(4 * SAMPLE_BYTES)
    contents = {"a": b"1" + middle + b"1", "b": b"2" + middle + b"1", "c": b"1" + middle + b"2"}
    assert check_duplicates({name: camera(tmp_path, name, content) for name, content in contents.items()}) == []
