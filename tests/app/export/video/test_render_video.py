"""Videos and sequences, decoded by others: what was drawn is in them, whole or not at all."""

from __future__ import annotations

import av
import numpy as np
import pytest
from msgspec import structs
from PIL import Image

from app.background.jobs import JobCancelled
from app.export.scene_frames import SceneFrames
from app.export.video import render as render_module
from app.export.video.drawing import draw
from app.export.video.render import render_video
from app.export.video.views import camera_view
from engine.errors import DiskError, ProjectError
from engine.progress import Progress
from tests.app.export.video.conftest import CAMERA, Films, decoded, psnr_of
from tests.engine.export.test_exr import read as read_exr
from tests.engine.synchronisation.made_recordings import write_sound_video


def test_an_mp4_begins_with_its_index_so_that_it_plays_while_it_loads(films: Films):
    films.render("a.mp4", "mp4", frames=range(0, 2))
    data = (films.folder / "a.mp4").read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")


def test_odd_sizes_are_padded_for_h264_and_kept_elsewhere(films: Films):
    written = films.render("odd.mp4", "mp4", size=(47, 31), frames=range(0, 2))
    assert written.size == (48, 32)
    assert "47 x 31 is written as 48 x 32" in written.notes[0]
    picture = decoded(films.folder / "odd.mp4")[0]
    assert picture.shape == (32, 48, 3)
    assert np.abs(picture[-1].astype(int) - picture[-2]).max() <= 6
    for name, format_name in (("odd.webm", "webm"), ("odd", "png")):
        assert films.render(name, format_name, size=(47, 31), frames=range(0, 2)).size == (47, 31)
    assert decoded(films.folder / "odd.webm")[0].shape == (31, 47, 3)


def test_png_files_are_named_by_their_frames_and_hold_the_picture_exactly(films: Films):
    films.render("pictures", "png", frames=range(2, 5))
    assert sorted(path.name for path in (films.folder / "pictures").iterdir()) == [
        f"frame_{frame:06d}.png" for frame in (2, 3, 4)
    ]
    assert np.array_equal(np.asarray(Image.open(films.folder / "pictures" / "frame_000003.png")), films.live(3))


def drawn(films: Films, moment: float = 0.0):
    return draw(SceneFrames(films.opened), moment, camera_view(films.opened.capture.rig, CAMERA, None)(0, 0.0))


def test_opacity_is_kept_in_png_webm_and_exr(films: Films):
    expected = drawn(films)
    assert expected.alpha.min() < 0.1
    assert expected.alpha.max() > 0.5
    films.render("png", "png", frames=range(0, 1), is_transparent=True)
    image = np.asarray(Image.open(films.folder / "png" / "frame_000000.png"))
    assert np.abs(image[..., 3] / 255.0 - expected.alpha).max() < 0.003
    over_black = image[..., :3] * (image[..., 3:] / 255.0)
    assert psnr_of(over_black, 255.0 * expected.color) > 45.0

    films.render("exr", "exr", frames=range(0, 1))
    channels = read_exr(films.folder / "exr" / "frame_000000.exr")
    assert np.abs(channels["A"].astype(np.float32) - expected.alpha).max() < 0.001
    linear = np.stack([channels[name].astype(np.float64) for name in "RGB"], axis=2)
    alpha = np.maximum(expected.alpha, 1e-6)[..., None]
    encoded = np.where(
        linear / alpha <= 0.0031308, 12.92 * linear / alpha, 1.055 * (linear / alpha) ** (1 / 2.4) - 0.055
    )
    assert psnr_of(255 * encoded * alpha, 255 * expected.color) > 55.0

    films.render("clear.webm", "webm", frames=range(0, 2), is_transparent=True)
    with av.open(str(films.folder / "clear.webm")) as container:
        decoder = av.CodecContext.create("libvpx-vp9", "r")  # the one that knows of opacity
        frames = [frame for packet in container.demux(video=0) for frame in decoder.decode(packet)]
    assert [frame.format.name for frame in frames] == ["yuva420p"] * 2
    found = np.frombuffer(bytes(frames[0].planes[3]), np.uint8).reshape(32, -1)[:, :48]
    assert psnr_of(found, 255.0 * expected.alpha) > 36.0


def test_a_background_is_behind_what_is_not_covered(films: Films):
    expected = drawn(films)
    films.render("green", "png", frames=range(0, 1), background=(0, 255, 0))
    image = np.asarray(Image.open(films.folder / "green" / "frame_000000.png")).astype(float)
    assert psnr_of(image[..., 1], 255 * np.clip(expected.color[..., 1] + 1 - expected.alpha, 0, 1)) > 50.0
    assert psnr_of(image[..., 0], 255 * expected.color[..., 0]) > 50.0


def test_depth_comes_in_its_unit_as_png_and_as_numbers_in_exr(films: Films):
    expected = drawn(films).depth
    is_seen = ~np.isnan(expected)
    assert is_seen.any()
    assert not is_seen.all()
    unit = films.render("depth", "png", frames=range(0, 1), shows="depth").depth_unit
    assert unit is not None
    with Image.open(films.folder / "depth" / "frame_000000.png") as image:
        assert f"{unit:g} scene units" in image.text["Depth"]  # type: ignore[attr-defined]
        levels = np.asarray(image)
    assert levels.dtype == np.uint16
    assert np.array_equal(levels > 0, is_seen)
    assert np.abs(levels[is_seen] * unit - expected[is_seen]).max() <= 0.51 * unit
    films.render("z", "exr", frames=range(0, 1), shows="opacity")
    assert np.abs(read_exr(films.folder / "z" / "frame_000000.exr")["Y"] - drawn(films).alpha).max() < 1e-6


def test_sound_is_as_long_as_the_pictures_and_begins_with_them(films: Films, monkeypatch: pytest.MonkeyPatch):
    rate, fps = 48_000, films.opened.capture.fps
    sound = np.zeros(rate)
    click_s = 0.3 + 3.5 / fps
    sound[round(click_s * rate)] = 1.0
    source = films.folder.parent / "source.mp4"
    write_sound_video(source, sound, n_frames=30)
    monkeypatch.setattr(
        "app.export.video.plan.sound_source", lambda capture, camera, frame: (source, 0.3 + frame / fps)
    )
    for name in ("s.mp4", "s.webm"):
        films.render(name, name[2:], frames=range(1, 6), sound=films.opened.capture.rig.names[0])
        with av.open(str(films.folder / name)) as container:
            frames = list(container.decode(audio=0))
        samples = np.concatenate([frame.to_ndarray()[0] for frame in frames])
        first_s = float(frames[0].time or 0.0)
        assert first_s + int(np.argmax(np.abs(samples))) / rate == pytest.approx(2.5 / fps, abs=0.003)
        assert first_s + len(samples) / rate == pytest.approx(5 / fps, abs=0.025)  # in whole packets
        assert len(decoded(films.folder / name)) == 5
    slow = films.render("slow.mp4", "mp4", frames=range(1, 6), sound=films.opened.capture.rig.names[0], speed=0.5)
    assert "The sound is left out" in slow.notes[0]
    with av.open(str(films.folder / "slow.mp4")) as container:
        assert not container.streams.audio


@pytest.mark.parametrize("name", ["a.mp4", "a.webm", "png", "exr"])
def test_what_is_cancelled_or_fails_half_way_leaves_nothing(films: Films, name: str, monkeypatch: pytest.MonkeyPatch):
    job = films.job(name, name[2:] if "." in name else name)
    seen: list[Progress] = []
    with pytest.raises(JobCancelled):
        render_video(job, films.opened, seen.append, lambda: len(seen) == 3)
    assert [progress.done for progress in seen] == pytest.approx([1 / 6, 2 / 6, 3 / 6])
    assert "3/6" in seen[-1].message

    with pytest.raises(JobCancelled):
        render_video(job, films.opened, is_cancelled=lambda: True)

    def interrupt(progress: Progress) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render_video(job, films.opened, interrupt)
    films.opened.project.clip_path(1).rename(films.opened.project.folder / "kept")  # vanishes after it was checked
    monkeypatch.setattr(SceneFrames, "check", lambda self, frames: None)
    with pytest.raises(ProjectError):
        render_video(structs.replace(job, frames=range(0, 6)), films.opened)
    assert films.names == []


@pytest.mark.parametrize("name", ["a.mp4", "png", "exr"])
def test_a_full_disk_is_said_and_leaves_nothing(films: Films, name: str, monkeypatch: pytest.MonkeyPatch):
    def refuse(*arguments: object, **options: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("app.export.video.writers.film.FilmWriter.write", refuse)
    monkeypatch.setattr(render_module, "_write_file", refuse)
    with pytest.raises(DiskError, match="No space left") as error:
        films.render(name, name[2:] if "." in name else name)
    assert "Free some space" in error.value.hint
    assert films.names == []


def test_a_video_takes_the_place_of_an_older_one_and_a_folder_does_not(films: Films):
    (films.folder / "a.mp4").write_bytes(b"old")
    films.render("a.mp4", "mp4", frames=range(0, 2))
    assert len(decoded(films.folder / "a.mp4")) == 2
    (films.folder / "full").mkdir()
    (films.folder / "full" / "mine").write_text("x")
    with pytest.raises(ProjectError, match="already taken"):
        films.render("full", "png")
    assert [path.name for path in (films.folder / "full").iterdir()] == ["mine"]
