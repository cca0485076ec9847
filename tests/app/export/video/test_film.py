"""Films by themselves: what colours come back, and encoders that are missing."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest
from av.codec.codec import UnknownCodecError

from app.export.video.formats import FORMATS, MissingCodecError, check_codecs, format_of
from app.export.video.passes import PassPicture
from app.export.video.writers.film import FilmWriter
from engine.errors import ProjectError
from tests.app.export.video.conftest import Films, decoded

FLAT = ((255, 0, 0), (0, 255, 0), (0, 0, 255), (128, 128, 128), (255, 255, 255), (0, 0, 0), (200, 150, 100))


@pytest.mark.parametrize("format_name", ["mp4", "webm", "prores", "dnxhr"])
def test_every_colour_comes_back_within_two_levels(tmp_path: Path, format_name: str):
    path = tmp_path / f"flat{FORMATS[format_name].suffixes[0]}"
    height, width = np.maximum((36, 48), FORMATS[format_name].min_size[::-1])
    with FilmWriter(path, format_name, fps=25.0) as film:
        for color in FLAT:
            plane = np.broadcast_to(np.array(color, np.float32) / np.float32(255.0), (height, width, 3))
            film.write(PassPicture(plane, np.ones((height, width), np.float32), None))
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
    assert error.value.hint == "Available: webm, prores, dnxhr, png, exr."
    assert films.names == []
    monkeypatch.setattr("av.codec.Codec", without("libopus"))
    check_codecs("webm")
    with pytest.raises(MissingCodecError, match="built without libopus") as error:
        check_codecs("webm", needs_sound=True)
    assert error.value.hint == "Available: mp4, prores, dnxhr, png, exr."


def test_ten_bits_and_opacity_come_through_prores(tmp_path: Path):
    """A ramp of 1,024 levels has more than 8 bits can hold, and opacity comes back within a level of 8 bits."""
    ramp = np.broadcast_to(np.linspace(0.0, 1.0, 1024, dtype=np.float32)[:, None], (64, 1024, 3))
    picture = PassPicture(ramp, np.ones((64, 1024), np.float32), None)
    with FilmWriter(tmp_path / "ramp.mov", "prores", fps=25.0) as film:
        film.write(picture)
    with av.open(tmp_path / "ramp.mov") as container:
        luma = next(container.decode(video=0)).to_ndarray(format="gray16le")
    assert len(np.unique(luma[32])) > 700
    alpha = np.broadcast_to(np.linspace(0.0, 1.0, 256, dtype=np.float32), (64, 256))
    with FilmWriter(tmp_path / "alpha.mov", "prores", fps=25.0, is_transparent=True) as film:
        film.write(PassPicture(0.5 * np.repeat(alpha[..., None], 3, axis=2), alpha, None))
    with av.open(tmp_path / "alpha.mov") as container:
        rgba = next(container.decode(video=0)).to_ndarray(format="rgba")
    assert np.abs(rgba[..., 3] / 255.0 - alpha).max() < 1.5 / 255.0
    assert np.abs(rgba[:, 32:, :3].astype(int) - 128).max() <= 3


def test_too_small_a_picture_is_refused_before_the_work(films: Films):
    with pytest.raises(ProjectError, match="at least 256 x 120"):
        films.render("a.mov", "dnxhr")
    assert films.names == []
