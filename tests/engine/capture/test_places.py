"""Files of a capture lie inside its folder, or the user has allowed links."""

import pytest

from engine.capture.files.places import MAX_NAME_BYTES, place_in
from engine.errors import CaptureError


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "capture" / "inner").mkdir(parents=True)
    (tmp_path / "secret").write_text("s")
    return tmp_path / "capture"


def place(folder, name, *, follow_links=False):
    return place_in(folder, name, follow_links=follow_links, named_in=folder / "cameras.json")


@pytest.mark.parametrize("name", ["a.mp4", "inner/a.mp4", "inner/../a.mp4", "not there"])
def test_names_inside_the_folder(folder, name):
    assert place(folder, name) == folder / name


@pytest.mark.parametrize("name", ["", "  ", "a\0b", "x" * (MAX_NAME_BYTES + 1), "\ud800"])
def test_what_is_not_a_file_name_is_refused_even_where_links_are_followed(folder, name):
    with pytest.raises(CaptureError):
        place(folder, name, follow_links=True)


@pytest.mark.parametrize("name", ["../secret", ".", "inner/../..", "../capture-2/a"])
def test_names_that_lead_out_are_refused(folder, name):
    with pytest.raises(CaptureError, match="is not inside its folder"):
        place(folder, name)


def test_links_out_are_told_with_where_they_lead_and_followed_where_that_is_allowed(folder):
    (folder / "link").symlink_to(folder.parent / "secret")
    with pytest.raises(CaptureError, match=r"is a link that leads out of the capture folder, to .*secret"):
        place(folder, "link")
    assert place(folder, "link", follow_links=True).read_text() == "s"


def test_a_link_within_the_folder_is_fine(folder):
    (folder / "a").write_text("a")
    (folder / "inner" / "b").symlink_to(folder / "a")
    assert place(folder, "inner/b").read_text() == "a"
