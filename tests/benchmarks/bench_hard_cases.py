"""Hard cases, one small capture each: train its first two clips with the default settings, and measure them.

    python -m tests.benchmarks.bench_hard_cases out/hard
    python -m tests.benchmarks.bench_hard_cases out/hard --cases text,near --set quality=draft

OUT/CASE/capture and OUT/CASE/project are taken up where they are: take another OUT for other settings. Two cameras of
the ring are held out, and figures are means over them and all frames of a clip: PSNR (of pixels that move by the
program's own masks, and of the rest), FLIP, and flicker, the change of the render from frame to frame inside the clip
where the truth stands still, in 1/255. Sensor noise is part of the pictures and bounds PSNR at 48 dB. Seconds and kB
are those of training and of the clip's file; seconds say something only where nothing else runs.

OUT/CASE.png shows truth, render and error side by side in the last frame of each clip, through the held-out camera that
sees more of what moves. Lengths are metres, and motion is scaled to the length of a clip.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import map_coordinates

from app.cli.cli import main as clipgstream
from app.evaluation.evaluation import evaluate_project
from app.evaluation.headless import TrainedProject, open_trained
from app.export.jobs.video import VideoJob
from app.export.scene_frames import SceneFrames
from app.export.video.moments import Moment
from app.export.video.passes import Painter
from app.export.video.views import camera_view
from app.lab.flicker import flicker_figures
from app.lab.synthetic import meshes, textures
from app.lab.synthetic.raycast import make_truth
from app.lab.synthetic.rigs import make_rig
from app.lab.synthetic.scene import (
    ROOM_SIZE,
    SAMPLE_CAMERAS,
    Part,
    SyntheticScene,
    make_parts,
    make_room,
    make_scene,
    placed,
    still,
    tilted,
)
from app.lab.synthetic.textures import Texture, mix, rgb, step
from app.lab.synthetic.writing import cameras_document
from app.project.opening.project_access import open_project
from engine.storage.json_files import json_text
from tests.benchmarks.options import ending_on_bad_input, names
from tests.documents.table import table
from tests.long_captures.changes import Change, make_change
from tests.long_captures.writing import write_long_captures

N_CLIPS = 2
"""From the first: the reference clip and one source clip."""
HEADINGS = ("case", "clip", "PSNR", "moving", "still", "FLIP", "flicker", "seconds", "kB")
FEWER_CAMERAS = 12
"""Of the case with fewer than the sample's: 30 degrees apart instead of 18."""
FURNITURE = ("pillar", "crate", "plinth")
PLINTH_TOP = (-0.35, -0.3, 0.5)
"""Middle of its upper face."""

LINES = (("CLIPS OF TEN FRAMES", 0.42), ("Twenty cameras read this wall", 0.29))
"""Words on a wall and the size of their font; they repeat from top to bottom."""
TEXELS = 100
"""Of the lettering, per metre."""

FINGER_RADIUS, SEGMENT_LENGTHS = 0.016, (0.17, 0.14)
"""A finger is three to four pixels thick in a picture 320 wide, and bends in the middle."""
FINGERS = ((-0.13, 0.40, -50.0), (-0.09, 0.57, -9.0), (-0.03, 0.57, -3.0), (0.03, 0.57, 3.0), (0.09, 0.57, 9.0))
"""Of the thumb and the others: where they start, to the side of the wrist and above it, and degrees to the side."""

NEAR_AZIMUTH_DEG, NEAR_RADIUS = 87.0, 2.0
"""Where the one who sways stands: half a metre from the lens of cam04, and at the rim of the held-out cam05."""
TORSO_WIDTH = 0.54
"""From arm to arm."""

SHADOW_FRAMES, SHADOW_FROM = 300, 140
"""Frames in which the shadow crosses the floor, as in the long captures: 18 mm a frame, a pixel and a half at 320. It
starts at this one, so that it lies near the middle of the room."""


def text(clip_length: int) -> tuple[Part, ...]:
    """Two walls full of letters, and someone who walks along between them."""

    def walk(frame: int) -> np.ndarray:
        return placed(-0.8 + 0.8 * frame / clip_length, 0.1, 0)

    return (*make_room(lettered_room), *furniture("pillar", "crate"), person("walker", "b8402f", walk))


def glossy(clip_length: int) -> tuple[Part, ...]:
    """A dark, glossy sphere on the plinth, whose highlight is elsewhere in every camera; the ball flies round it."""
    x, y, z = PLINTH_TOP
    sphere = Part("sphere", meshes.sphere(0.3), painted("3a1420"), still(placed(x, y, z + 0.3)), gloss=1.6)
    ball = [part for part in make_parts(clip_length) if part.name == "ball"]
    return (*make_room(), *furniture(), sphere, *ball)


def fingers(clip_length: int) -> tuple[Part, ...]:
    """A hand on the plinth: its wrist turns, and five thin fingers curl one after the other."""
    forearm = meshes.cylinder(0.045, 0.35).moved(placed(0, 0, 0.175))
    palm = meshes.joined([forearm, meshes.box((0.24, 0.06, 0.22)).moved(placed(0, 0, 0.46))])
    parts = [Part("palm", palm, painted("c98f6b"), partial(wrist, clip_length), is_moving=True)]
    for finger in range(len(FINGERS)):
        for joint, length in enumerate(SEGMENT_LENGTHS):
            mesh = meshes.cylinder(FINGER_RADIUS, length, n_around=16).moved(placed(0, 0, length / 2))
            pose = partial(segment, clip_length, finger, joint)
            parts.append(Part(f"finger{finger}.{joint}", mesh, painted("e0ac86"), pose, is_moving=True))
    return (*make_room(), *furniture(), *parts)


def near(clip_length: int) -> tuple[Part, ...]:
    """Someone who sways before one camera, so near that the picture shows little else."""
    azimuth = np.radians(NEAR_AZIMUTH_DEG)
    x, y = NEAR_RADIUS * np.cos(azimuth), NEAR_RADIUS * np.sin(azimuth)

    def sway(frame: int) -> np.ndarray:
        lean_deg = 6.0 * np.sin(np.pi * frame / clip_length)
        return placed(x, y, 0, turn_deg=NEAR_AZIMUTH_DEG - 90) @ sideways(lean_deg)

    return (*make_room(), *furniture(), person("near", "2f6db8", sway))


def shadow(clip_length: int) -> tuple[Part, ...]:
    """The shadow of nothing creeps over the floor; all that moves is a small ball far from it."""

    def bob(frame: int) -> np.ndarray:
        return placed(1.1, -1.1, 1.3 + 0.12 * np.sin(2 * np.pi * frame / clip_length))

    ball = Part("ball", meshes.sphere(0.11), textures.beach_ball, bob, is_moving=True)
    return (*make_room(), *furniture(), ball)


def touch(clip_length: int) -> tuple[Part, ...]:
    """Two who come together, touch where the clips meet, and part."""

    def beside(side: int, frame: int) -> np.ndarray:
        gap = 0.3 * (1 + np.cos(np.pi * frame / clip_length))
        return placed(side * (TORSO_WIDTH + gap) / 2, 0, 0)

    left, right = (partial(beside, side) for side in (-1, 1))
    people = (person("left", "b8402f", left), person("right", "3f8a4f", right))
    return (*make_room(), *furniture("pillar", "crate"), *people)


PARTS: dict[str, Callable[[int], tuple[Part, ...]]] = {
    make.__name__: make for make in (text, glossy, fingers, near, shadow, touch)
}
"""Case -> parts of its scene from the length of a clip."""
CASES = (*PARTS, "twelve")
"""The last is the scene of the sample, with fewer cameras."""


def case_scene(name: str, *, size: tuple[int, int], n_frames: int, clip_length: int) -> SyntheticScene:
    """The scene of a case. Size: width and height of the pictures."""
    if name not in PARTS:
        return make_scene(size=size, n_cameras=FEWER_CAMERAS, n_frames=n_frames, clip_length=clip_length)
    return SyntheticScene(PARTS[name](clip_length), make_rig(SAMPLE_CAMERAS, size), n_frames, clip_length, 30.0)


def case_change(name: str, scene: SyntheticScene) -> Change:
    """What changes beside the motion: nothing, or the light."""
    if name != "shadow":
        return make_change("none", scene)
    change = make_change("shadow", replace(scene, n_frames=SHADOW_FRAMES))
    return replace(change, light=lambda frame, positions: change.light(frame + SHADOW_FROM, positions))


def furniture(*chosen: str) -> Iterator[Part]:
    """Things of the sample that stand; all without names."""
    return (part for part in make_parts(1) if part.name in (chosen or FURNITURE))


def person(name: str, shirt: str, pose: Callable[[int], np.ndarray]) -> Part:
    """Someone 1.67 tall, upright on the origin, with arms along x. The shirt's colour: six hex digits."""
    body = [meshes.cylinder(0.17, 0.62).moved(placed(0, 0, 1.08)), meshes.sphere(0.12).moved(placed(0, 0, 1.55))]
    for side in (-1, 1):
        body.append(meshes.cylinder(0.08, 0.78).moved(placed(side * 0.09, 0, 0.39)))
        body.append(meshes.cylinder(0.05, 0.6).moved(placed(side * (TORSO_WIDTH / 2 - 0.05), 0, 1.07)))
    return Part(name, meshes.joined(body), clothes(shirt), pose, is_moving=True)


def clothes(shirt: str) -> Texture:
    """Dark trousers, a striped shirt and skin, by height."""

    def texture(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        height = points[:, 2]
        stripes = mix(rgb(shirt), rgb("e8dcc0"), step(np.sin(height * 60), 0.4, 0.5))
        cloth = mix(rgb("39404f"), stripes, step(height, 0.78, 0.02))
        cloth = cloth * (0.75 + 0.5 * textures.cloudy(points * 9.0, 121))[:, None]
        return mix(cloth, rgb("d9a987"), step(height, 1.41, 0.02))

    return texture


def painted(paint: str) -> Texture:
    """One colour everywhere, six hex digits."""
    return lambda points, normals: np.broadcast_to(rgb(paint), points.shape)


def lettered_room(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """The sample's room with letters on the two walls across the y axis."""
    color = textures.room(points, normals)
    wall = np.abs(normals[:, 1]) > 0.5
    along = ROOM_SIZE[0] / 2 - normals[wall, 1] * points[wall, 0]  # from left to right, seen from inside
    ink = map_coordinates(lettering(), [(ROOM_SIZE[2] - points[wall, 2]) * TEXELS, along * TEXELS], order=1)
    paper = rgb("e6dfcc") * (0.9 + 0.2 * textures.cloudy(points[wall][:, [0, 2]] * 2.0, 131))[:, None]
    color[wall] = mix(paper, rgb("1d2a44"), ink)
    return color


@cache
def lettering() -> np.ndarray:
    """Share of ink on a wall. [height, width] float64 in 0..1, TEXELS per metre, from the upper left"""
    image = Image.new("L", (round(ROOM_SIZE[0] * TEXELS), round(ROOM_SIZE[2] * TEXELS)))
    draw, y = ImageDraw.Draw(image), 0.1
    while y < ROOM_SIZE[2]:
        for words, size in LINES:
            font = ImageFont.load_default(size * TEXELS)
            draw.text((0.15 * TEXELS, y * TEXELS), words + " · " + words, fill=255, font=font)
            y += 1.15 * size
    return np.asarray(image) / 255.0


def wrist(clip_length: int, frame: int) -> np.ndarray:
    """The wrist of the hand: it turns to and fro. [4, 4]"""
    return placed(*PLINTH_TOP, turn_deg=25.0 * np.sin(np.pi * frame / clip_length))


def segment(clip_length: int, finger: int, joint: int, frame: int) -> np.ndarray:
    """The lower (0) or upper (1) half of a finger, from its joint on. [4, 4]"""
    across, up, aside_deg = FINGERS[finger]
    curl = tilted(35.0 * (1 - np.cos(np.pi * (frame / clip_length + 0.25 * finger))))
    pose = wrist(clip_length, frame) @ placed(across, 0, up) @ sideways(aside_deg) @ curl
    return pose if joint == 0 else pose @ placed(0, 0, SEGMENT_LENGTHS[0]) @ curl


def sideways(angle_deg: float) -> np.ndarray:
    """Turn about y: z towards x. [4, 4]"""
    return placed(0, 0, 0, turn_deg=90) @ tilted(angle_deg) @ placed(0, 0, 0, turn_deg=-90)


def write_missing(folder: Path, name: str, scene: SyntheticScene) -> None:
    """Write the capture of a case unless it is there complete."""
    path = folder / "capture" / "cameras.json"
    if path.is_file() and json.loads(path.read_text()) == json.loads(json_text(cameras_document(scene))):
        return
    path.unlink(missing_ok=True)
    print(f"writing {name}", file=sys.stderr)
    write_long_captures(folder, scene, {"capture": case_change(name, scene)})


def measure(opened: TrainedProject, name: str) -> list[tuple[str, ...]]:
    """A row of the table per clip; see HEADINGS."""
    document = evaluate_project(
        opened,
        clip_indices=range(N_CLIPS),
        cameras=opened.capture.camera_indices(opened.project.settings.holdout),
        on_progress=lambda n_done, n_rows, row: None,
    )
    rows = []
    for i in range(N_CLIPS):
        means = document["means"]["clips"][str(i)]["held_out"]
        pairs = [pair for pair in document["seams"]["rows"] if pair["clip_index"] == i]
        figures = [(means[key], 2) for key in ("psnr", "psnr_moving", "psnr_rest")]
        figures += [(means["flip"], 4), (flicker_figures(pairs)["flicker_inside"], 3)]
        figures += [(opened.header(i).figures.seconds, 1), (opened.project.clip_path(i).stat().st_size / 1e3, 0)]
        cells = ["-" if value is None else f"{value:.{digits}f}" for value, digits in figures]
        rows.append((name, str(i), *cells))
    return rows


def write_picture(path: Path, opened: TrainedProject, scene: SyntheticScene) -> None:
    """Truth, render and error from left to right, a row per clip."""
    frames = [opened.clips[i].stop - 1 for i in range(N_CLIPS)]

    def moving_pixels(camera: int) -> int:
        return sum(int(make_truth(scene, camera, frame).is_moving.sum()) for frame in frames)

    camera = max(opened.capture.camera_indices(opened.project.settings.holdout), key=moving_pixels)
    job = VideoJob(path, camera=opened.capture.rig.names[camera], shows="compare")
    moments = [Moment(frame, frame) for frame in frames]
    painter = Painter(SceneFrames(opened), job, moments, camera_view(opened.capture.rig, camera, None), 1.0)
    Image.fromarray(np.concatenate([painter.picture(i).over((0, 0, 0)) for i in range(N_CLIPS)])).save(path)


def main() -> None:
    """Command line; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder of captures, projects and pictures")
    parser.add_argument("--cases", default=",".join(CASES), help="names, separated by commas")
    parser.add_argument("--set", nargs="*", default=[], metavar="KEY=VALUE", help="training settings")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--width", type=int, default=320, help="of the pictures, which are 16:9")
    parser.add_argument("--clip-length", type=int, default=10, help="frames per clip; a capture has two")
    options = parser.parse_args()
    size, clip_length = (options.width, options.width * 9 // 16), options.clip_length
    arguments = ["--quiet", "--clips", f"0:{N_CLIPS}", "--clip-length", str(clip_length), "--seed", str(options.seed)]
    arguments += [part for setting in options.set for part in ("--set", setting)]
    rows: list[tuple[str, ...]] = []
    for name in names(options.cases, list(CASES), parser):
        scene = case_scene(name, size=size, n_frames=N_CLIPS * clip_length, clip_length=clip_length)
        folder = options.out / name
        write_missing(folder, name, scene)
        print(f"training {name}", file=sys.stderr)
        if code := clipgstream(["train", str(folder / "capture"), "--project", str(folder / "project"), *arguments]):
            sys.exit(code)
        with ending_on_bad_input():
            opened = open_trained(open_project(folder / "project", is_writable=False))
            rows += measure(opened, name)
            write_picture(options.out / f"{name}.png", opened, scene)
    print(table(HEADINGS, rows))


if __name__ == "__main__":
    main()
