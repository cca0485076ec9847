"""What pictures show: views, passes, slow motion, of a training of the sample."""

from __future__ import annotations

from dataclasses import replace

import av
import numpy as np
import pytest

from app.document.history import Changed
from app.export.jobs.video import Turntable
from app.export.scene_frames import SceneFrames
from app.export.video.drawing import draw
from app.export.video.views import camera_view
from engine.camera.camera_path import CameraKey, CameraPath
from engine.camera.projection import pinhole_K, vertical_fov
from engine.camera.rig import CameraRig
from engine.errors import ProjectError
from engine.metrics.pictures.colors import to_levels
from tests.app.export.video.conftest import CAMERA, Films, decoded, images_in, psnr_of
from tests.engine.export.test_exr import read as read_exr


@pytest.mark.parametrize(("name", "least_db"), [("a.mp4", 35.0), ("a.webm", 35.0)])
def test_a_video_holds_every_picture_in_its_colours(sample_films: Films, name: str, least_db: float):
    films = sample_films
    written = films.render(name, name[2:], frames=range(0, 6))
    assert (written.n_pictures, written.size, written.notes) == (6, (80, 60), ())
    assert written.n_bytes == (films.folder / name).stat().st_size
    pictures = decoded(films.folder / name)
    assert len(pictures) == 6
    for frame, picture in enumerate(pictures):
        assert psnr_of(picture, films.live(frame)) > least_db
    with av.open(str(films.folder / name)) as container:
        context = container.streams.video[0].codec_context
        assert (context.pix_fmt, context.colorspace, context.color_range) == ("yuv420p", 1, 1)
        assert (context.color_primaries, context.color_trc) == (1, 1)
        assert float(container.streams.video[0].average_rate or 0) == films.opened.capture.fps


def test_all_that_is_trained_is_rendered_unless_frames_are_chosen(sample_films: Films):
    assert sample_films.render("all", "png", size=(8, 6)).n_pictures == 6
    with pytest.raises(ProjectError, match="Frame 6 lies in clip 2, which is not trained") as error:
        sample_films.render("more", "png", frames=range(4, 8))
    assert "--frames 0:6" in error.value.hint
    assert sample_films.names == ["all"]


def test_pictures_are_those_of_an_evaluation(sample_films: Films):
    trained = sample_films.opened.load(1)
    rig = sample_films.opened.capture.rig
    for camera in (0, CAMERA, rig.names.index("cam05")):  # a held-out one too
        expected = to_levels(trained.picture(rig, camera, trained.clip.clip_time(4)))
        assert psnr_of(sample_films.live(4, camera), expected) > 50.0


def test_side_by_side_has_the_truth_the_render_and_the_error_in_it(sample_films: Films):
    films = sample_films
    written = films.render("beside", "png", frames=range(4, 5), shows="compare")
    assert written.size == (3 * 80, 60)
    (image,) = images_in(films.folder / "beside")
    truth, render, error = (image[:, 80 * part : 80 * (part + 1)] for part in range(3))
    assert np.array_equal(truth, films.opened.capture.frame(CAMERA, 4))
    assert np.array_equal(render, films.live(4))
    distance = np.minimum(np.abs(truth.astype(float) - render).mean(axis=2), 51.0)
    brightness = error.astype(float) @ (0.2126, 0.7152, 0.0722)
    assert distance.max() > 20
    assert np.corrcoef(distance.ravel(), brightness.ravel())[0, 1] > 0.95  # the map grows lighter with the error
    for wrong, message in (({"speed": 0.5}, "not between"), ({"size": (40, 30)}, "Leave the size out")):
        with pytest.raises(ProjectError, match=message):
            films.render("wrong", "png", frames=range(4, 6), shows="compare", **wrong)


def test_change_is_what_differs_from_the_moment_before(sample_films: Films):
    films = sample_films
    films.render("change", "exr", frames=range(0, 6), shows="change")
    changes = [read_exr(path)["Y"] for path in sorted((films.folder / "change").iterdir())]
    assert changes[0].max() == 0.0  # nothing came before it
    scene = SceneFrames(films.opened)
    view = camera_view(films.opened.capture.rig, CAMERA, None)(0, 0.0)
    for frame in (3, 5):  # where two clips meet, and inside of one
        now, before = (draw(scene, moment, view).color for moment in (frame, frame - 1))
        assert np.abs(changes[frame] - 255 * np.abs(now - before).mean(axis=2)).max() < 1e-3
        assert changes[frame].max() > 5.0
    films.render("still", "exr", frames=range(0, 2), shows="change", hold=3.0)
    assert read_exr(films.folder / "still" / "picture_000001.exr")["Y"].max() == 0.0
    turning = {"turntable": Turntable(), "shows": "change", "frames": range(0, 2)}
    films.render("turning", "exr", hold=3.0, **turning)  # what the camera does is not a change
    assert read_exr(films.folder / "turning" / "picture_000001.exr")["Y"].max() == 0.0
    films.render("moving", "exr", **turning)
    assert read_exr(films.folder / "moving" / "frame_000001.exr")["Y"].max() > 1.0


def test_slow_motion_shows_moments_between_frames_in_order(sample_films: Films):
    films = sample_films
    assert films.render("slow", "png", frames=range(0, 3), speed=0.25).n_pictures == 9
    names = sorted(path.name for path in (films.folder / "slow").iterdir())
    assert names == [f"picture_{number:06d}.png" for number in range(9)]
    levels = images_in(films.folder / "slow")
    pictures = [picture.astype(float) for picture in levels]
    for whole in (0, 4, 8):
        assert np.array_equal(levels[whole], films.live(whole / 4))
    for first in (0, 4):  # between two frames every picture lies farther from the first and nearer to the second
        from_first = [np.abs(pictures[first + k] - pictures[first]).mean() for k in range(5)]
        to_second = [np.abs(pictures[first + k] - pictures[first + 4]).mean() for k in range(5)]
        assert from_first == sorted(from_first)
        assert to_second == sorted(to_second, reverse=True)
        assert len(set(from_first)) == 5
    fps = films.opened.capture.fps
    assert films.render("60.mp4", "mp4", frames=range(0, 3), fps=2 * fps).n_pictures == 5
    assert films.render("fast", "png", frames=range(0, 6), speed=2.0).n_pictures == 3
    assert (films.folder / "fast" / "frame_000004.png").is_file()


def test_between_frames_what_moves_fades_over_and_is_not_seen_twice(sample_films: Films):
    films = sample_films
    scene = SceneFrames(films.opened)
    model, rig = scene.trained(1.0).model, films.opened.capture.rig
    (first, second), clip_time = (list(scene.shares(1.25)), 1.25 / 3)
    assert (first.weight, second.weight) == pytest.approx((0.75, 0.25))
    assert first.clip_time == second.clip_time == pytest.approx(clip_time)
    n_both = len(model.decode(clip_time))
    assert len(first.gaussians) < n_both  # what exists at the second frame only is not in it
    assert len(second.gaussians) < n_both
    before, between, after = (films.live(moment).astype(float) for moment in (1.0, 1.25, 2.0))
    assert psnr_of(between, 0.75 * before + 0.25 * after) > 35.0
    union = draw_all_at_once(scene, rig, 1.25)
    assert psnr_of(union, 0.75 * before + 0.25 * after) < psnr_of(between, 0.75 * before + 0.25 * after) - 3.0
    (whole,) = scene.shares(1.0)
    assert (whole.weight, len(whole.gaussians)) == (1.0, len(scene.gaussians(1.0)))


def draw_all_at_once(scene: SceneFrames, rig: CameraRig, moment: float) -> np.ndarray:
    """A moment with everything that exists at the frame before or after it."""
    trained = scene.trained(moment)
    return to_levels(trained.picture(rig, CAMERA, scene.clip_time(moment)))


def test_a_clip_fades_into_the_next_one(sample_films: Films, monkeypatch: pytest.MonkeyPatch):
    films = sample_films
    last, first = films.live(2.0).astype(float), films.live(3.0).astype(float)
    for moment, weight in ((2.25, 0.25), (2.5, 0.5), (2.75, 0.75)):
        assert psnr_of(films.live(moment), (1 - weight) * last + weight * first) > 45.0
    loads: list[int] = []
    load = type(films.opened).load
    monkeypatch.setattr(type(films.opened), "load", lambda self, index: loads.append(index) or load(self, index))
    films.render("slow", "png", frames=range(1, 5), speed=0.25)
    assert loads[:2] == [0, 1]  # looked at before the work
    assert len(loads) <= 2 + 4
    monkeypatch.undo()
    monkeypatch.setattr(type(films.opened), "trained", [0])  # a clip that is not there cannot be faded into
    assert np.array_equal(films.live(2.4), last)


def test_supersampling_reduces_what_was_drawn_larger(sample_films: Films):
    films = sample_films
    films.render("fine", "png", frames=range(0, 1), supersampling=3)
    films.render("large", "png", frames=range(0, 1), size=(240, 180))
    (fine,), (large,) = (images_in(films.folder / name) for name in ("fine", "large"))
    assert fine.shape == (60, 80, 3)
    assert 25.0 < psnr_of(fine, films.live(0)) < 60.0
    assert psnr_of(large.astype(float).reshape(60, 3, 80, 3, 3).mean(axis=(1, 3)), fine) > 45.0


def test_a_turntable_goes_round_and_can_be_looped(sample_films: Films):
    films = sample_films
    films.render("round", "png", turntable=Turntable(1.0, 10.0), frames=range(0, 4), hold=0.0)
    films.render("twice", "png", turntable=Turntable(2.0, 10.0), frames=range(0, 4), hold=0.0)
    quarter, half = (images_in(films.folder / name) for name in ("round", "twice"))
    assert psnr_of(half[1], quarter[2]) > 50.0
    assert psnr_of(half[2], quarter[0]) > 50.0
    assert psnr_of(quarter[1], quarter[0]) < 25.0
    assert min(picture.std() for picture in quarter) > 10.0  # there is something to be seen from all sides


def have_path(films: Films, path: CameraPath) -> None:
    project = films.opened.project
    document = replace(project.document, camera_paths=(path,))
    project.history = project.history.after(Changed("new camera path", document))


def test_a_camera_path_is_followed_while_time_runs_or_stands_still(sample_films: Films):
    films, rig = sample_films, sample_films.opened.capture.rig
    fov = vertical_fov(rig.Ks[1, 1, 1], 60.0)
    keys = (CameraKey(1.0, rig.world_to_camera[1], fov), CameraKey(4.5, rig.world_to_camera[CAMERA], fov))
    have_path(films, CameraPath("Way in", keys))
    assert films.render("path", "png", path="Way in").n_pictures == 4  # from key to key
    films.render("held", "png", path="Way in", hold=0.0)
    running, held = (images_in(films.folder / name) for name in ("path", "held"))
    scene = SceneFrames(films.opened)
    view = camera_view(rig, 1, (80, 60))(0, 0.0)
    view.K[:] = pinhole_K(fov, (80, 60))
    for pictures, moment in ((running, 1.0), (held, 0.0)):
        drawn = draw(scene, moment, view)
        own = films.opened.load(0).colors.in_camera(pictures[0] / np.float32(255.0), rig, 1, scene.clip_time(moment))
        assert psnr_of(255.0 * own, 255.0 * drawn.color) > 45.0  # along a path, colours are the scene's own
    assert psnr_of(running[0], held[0]) < 40.0
    with pytest.raises(ProjectError, match="no camera path called"):
        films.render("none", "png", path="Way out")
    have_path(films, CameraPath("Late", (keys[0].at_frame(90.0), keys[1].at_frame(99.0))))
    with pytest.raises(ProjectError, match="outside the frames of the capture"):
        films.render("late", "png", path="Late")
    assert films.render("late", "png", path="Late", hold=0.0, size=(8, 6)).n_pictures == 10


def test_features_apart_are_drawn_apart(sample_films: Films):
    films = sample_films
    for features in ("both", "static", "dynamic"):
        films.render(features, "png", features=features, frames=range(0, 6))
    both, static, dynamic = (images_in(films.folder / name) for name in ("both", "static", "dynamic"))
    assert psnr_of(static[0], dynamic[0]) < 40.0
    assert psnr_of(static[0], both[0]) < 60.0
    assert np.array_equal(both[2], films.live(2))
