"""Films by themselves: what colours come back, and encoders that are missing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from av.codec.codec import UnknownCodecError

from app.export.video.formats import MissingCodecError, check_codecs, format_of
from app.export.video.passes import PassPicture
from app.export.video.writers.film import FilmWriter
from engine.errors import ProjectError
from tests.app.export.video.conftest import Films, decoded

FLAT = ((255, 0, 0), (0, 255, 0), (0, 0, 255), (128, 128, 128), (255, 255, 255), (0, 0, 0), (200, 150, 100))


@pytest.mark.parametrize("format_name", ["mp4", "webm"])
def test_every_colour_comes_back_within_two_levels(tmp_path: Path, format_name: str):
    path = tmp_path / f"flat.{format_name}"
    with FilmWriter(path, format_name, fps=25.0) as film:
        for color in FLAT:
            plane = np.broadcast_to(np.array(color, np.float32) / np.float32(255.0), (36, 48, 3))
            film.write(PassPicture(plane, np.ones((36, 48), np.float32), None))
    for color, picture in zip(FLAT, decoded(path), strict=True):
        assert np.abs(picture.astype(int) - color).max() <= 2, color


def test_a_name_with_a_colon_is_a_file_and_not_a_protocol(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    with FilmWriter(Path("http:a.mp4"), "mp4", fps=25.0) as film:
        film.write(PassPicture(np.zeros((4, 4, 3), np.float32), np.ones((4, 4), np.float32), None))
    assert len(decoded(tmp_path / "http:a.mp4")) == 1


def test_the_format_is_chosen_by_the_name():
    names = {"a.mp4": "mp4", "a.MOV": "mp4", "b.webm": "webm", "folder": "png"}
    assert {name: format_of(Path(name)) for name in names} == names
    with pytest.raises(ProjectError, match="not a video format"):
        format_of(Path("a.gif"))


def test_a_missing_encoder_is_named_with_what_there_is_before_the_work(films: Films, monkeypatch: pytest.MonkeyPatch):
    def without(*missing: str):
        def codec(name: str, mode: str) -> None:
            if name in missing:
                raise UnknownCodecError(name)

        return codec

    monkeypatch.setattr("av.codec.Codec", without("libx264"))
    with pytest.raises(MissingCodecError, match="built without libx264") as error:
        films.render("a.mp4", "mp4")
    assert error.value.hint == "Available: webm, png, exr."
    assert films.names == []
    monkeypatch.setattr("av.codec.Codec", without("libopus"))
    check_codecs("webm")
    with pytest.raises(MissingCodecError, match="built without libopus") as error:
        check_codecs("webm", needs_sound=True)
    assert error.value.hint == "Available: mp4, png, exr."
