"""Damaged and hostile captures: whatever lies in the folder, opening it ends with a message or with right pictures.

Each case damages one thing in a small capture of either layout: bytes or values of a file, what lies under a name, a
name or a number in the calibration. `inspect` then runs as a user would run it, and the first and last frame of each
camera are decoded. Counted as faults: an exception that is not an EngineError, a traceback or a bug in the program
on standard error, a hang, a file opened outside of the capture, and JSON with NaN.

    python -m tests.faults.fuzz_capture --cases 1000 --seed 1
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from tests.faults.mutate import ODD_TEXTS, damaged_bytes, damaged_json, put_odd_file
from tests.faults.tally import Case, Outcome, fuzz_main, judge, take_outside, watch_files

SIZE = (48, 32)
N_FRAMES = 4
ODD_NAMES = (
    *("", " ", ".", "..", "/", "../outside.mp4", "/etc/passwd", "/dev/zero", "/dev/stdin", "../../../proc/kmsg"),
    *("a##b", "##", "%s%n", "\ud800", "\ud800.mp4", "\x00", "a\nb", "\x1b[2J\x1b]0;title\x07", "x" * 300, "y/" * 3000),
    *("http://127.0.0.1/a.mp4", "concat:cam00.mp4|cam01.mp4", "pipe:0", "file:cam01.mp4", "cam%02d.mp4", "\u202eabc"),
    *("con", "a/../cam01.mp4", "ims/../../outside", "cameras.json", "=HYPERLINK(1)", "--help", "cam00.mp4"),
)
CAME_ALONG = (
    *("capture.json", "masks", "mask", "points3D.ply", "points.ply", "init_pt_cld.npz", "sparse", "transforms.json"),
    *("calibration.toml", "intri.yml", "extri.yml", "poses_bounds.npy", "cam07.mp4", "images", "ims", "models.json"),
)
"""Names that readers look for, of other layouts too: nothing of a small capture, and whatever else may lie there."""
_PLACE = "put-the-odd-number-here"


def make_video_capture(folder: Path) -> None:
    """Three cameras with a video each."""
    from app.lab.synthetic.rigs import make_rig
    from app.lab.synthetic.writing import write_video

    folder.mkdir(parents=True)
    rig = make_rig(3, SIZE)
    cameras = []
    for i, name in enumerate(rig.names):
        write_video(folder / f"{name}.mp4", (_picture(i, t) for t in range(N_FRAMES)), fps=30.0)
        camera = {"name": name, "file": f"{name}.mp4", "width": SIZE[0], "height": SIZE[1]}
        cameras.append(camera | {"K": rig.Ks[i].tolist(), "world_to_camera": rig.world_to_camera[i].tolist()})
    document = {"schema": 1, "fps": 30, "n_frames": N_FRAMES, "default_holdout": ["cam01"], "cameras": cameras}
    (folder / "cameras.json").write_text(json.dumps(document))


def make_panoptic_capture(folder: Path) -> None:
    """Four cameras with an image per frame."""
    from app.lab.synthetic.rigs import make_rig

    rig = make_rig(4, SIZE)
    for name, ids in (("train_meta.json", (0, 1, 2)), ("test_meta.json", (3,))):
        document = {
            "w": SIZE[0],
            "h": SIZE[1],
            "k": [[rig.Ks[i].tolist() for i in ids]] * N_FRAMES,
            "w2c": [[rig.world_to_camera[i].tolist() for i in ids]] * N_FRAMES,
            "fn": [[f"{i}/{t:06d}.jpg" for i in ids] for t in range(N_FRAMES)],
            "cam_id": [list(ids)] * N_FRAMES,
        }
        for i in ids:
            (folder / "ims" / str(i)).mkdir(parents=True)
            for t in range(N_FRAMES):
                Image.fromarray(_picture(i, t)).save(folder / "ims" / str(i) / f"{t:06d}.jpg", quality=95)
        (folder / name).write_text(json.dumps(document))


def _picture(camera: int, frame: int) -> np.ndarray:
    return np.random.default_rng((camera, frame)).integers(0, 255, (SIZE[1], SIZE[0], 3)).astype(np.uint8)


# ---------------------------------------------------------------- damage


def damage(folder: Path, rng: random.Random) -> tuple[str, int]:
    """Damage one thing in a capture. Returns what, and the size of the file in bytes."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    calibration = [path for path in files if path.suffix == ".json"]
    kind = rng.choice(
        (
            "bytes",
            "bytes",
            "value",
            "value",
            "value",
            "odd file",
            "odd name",
            "number",
            "special",
            "odd folder",
            "came along",
        )
    )
    path = rng.choice(files if kind in ("bytes", "odd file", "special") else calibration)
    match kind:
        case "bytes":
            what, data = damaged_bytes(path.read_bytes(), rng)
            path.write_bytes(data)
        case "value":
            what, data = damaged_json(path.read_bytes(), rng)
            path.write_bytes(data)
        case "odd file":
            what = put_odd_file(path, rng)
        case "odd folder":
            path = rng.choice([found for found in folder.rglob("*") if found.is_dir()] or files)
            what = put_odd_file(path, rng)
        case "came along":
            path = folder / rng.choice(CAME_ALONG)
            what = put_odd_file(path, rng)
        case "odd name":
            what = _put_odd_name(path, rng)
        case "number":
            what = _put_odd_number(path, rng)
        case _:
            what = rng.choice(_SPECIAL)(path, rng)
    n_bytes = path.stat().st_size if path.is_file() else 0
    return f"{path.relative_to(folder)}: {kind}, {what}", n_bytes


def _put_odd_name(path: Path, rng: random.Random) -> str:
    """A name of a camera or file that is none, leads outside or does things to a terminal; or one twice."""
    document, name = json.loads(path.read_text()), rng.choice(ODD_NAMES)
    if "cameras" in document:
        key = rng.choice(("name", "file"))
        if rng.random() < 0.2:
            document["cameras"][1][key] = document["cameras"][0][key]
        else:
            document["cameras"][rng.randrange(3)][key] = name
    else:
        key, row = "fn", rng.choice(document["fn"])
        row[rng.randrange(len(row))] = name
    path.write_text(json.dumps(document))
    return f"{key} {name!r:.40}"


def _put_odd_number(path: Path, rng: random.Random) -> str:
    """A number of the calibration that no camera has, or not even JSON can hold."""
    document = json.loads(path.read_text())
    odd = rng.choice((*ODD_TEXTS[:8], "1e300", "-1e300", "1e-300", "0", "-1", "true", "65535", "16385", "2147483648"))
    if "cameras" in document:
        camera = rng.choice(document["cameras"])
        key = rng.choice(("fps", "n_frames", "schema", "width", "height", "K", "world_to_camera"))
        where: Any = document if key in document else camera
        if key in ("K", "world_to_camera"):
            where, at = rng.choice(camera[key]), rng.randrange(3)
        else:
            at = key
    else:
        key = rng.choice(("w", "h", "k", "w2c", "cam_id"))
        where, at = document, key
        if key not in ("w", "h"):
            where, at = rng.choice(document[key]), 0
        if key in ("k", "w2c"):
            where = rng.choice(where[0])
            at = rng.randrange(3)
    where[at] = _PLACE
    path.write_text(json.dumps(document).replace(f'"{_PLACE}"', odd))
    return f"{key} {odd:.12}"


def _huge_jpeg(path: Path, rng: random.Random) -> str:
    """A header that claims far more pixels than there are."""
    path = _some(path, ".jpg", rng)
    data = path.read_bytes() if path.suffix == ".jpg" else b""
    at = data.find(b"\xff\xc0")
    if at < 0:
        return _playlist(path, rng)
    path.write_bytes(data[: at + 5] + b"\xff\xff\xff\xff" + data[at + 9 :])
    return "JPEG of 65535x65535"


def _playlist(path: Path, rng: random.Random) -> str:
    """A text that makes FFmpeg open other files, where it is let."""
    path = _some(path, ".mp4", rng)
    texts = {
        "HLS": "#EXTM3U\n#EXTINF:1,\ncam02.mp4\n#EXTINF:1,\n/etc/passwd\n#EXT-X-ENDLIST\n",
        "ffconcat": "ffconcat version 1.0\nfile 'cam02.mp4'\n",
        "SDP": "v=0\no=- 0 0 IN IP4 127.0.0.1\nm=video 9 RTP/AVP 96\na=rtpmap:96 H264/90000\n",
        "PostScript": "%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 48 32\n(/etc/passwd) run\n",
    }
    name = rng.choice(sorted(texts))
    path.write_text(texts[name])
    return name


def _turned(path: Path, rng: random.Random) -> str:
    """An EXIF entry that turns the picture."""
    path = _some(path, ".jpg", rng)
    if path.suffix != ".jpg":
        return _copied(path, rng)
    exif = Image.Exif()
    exif[0x0112] = rng.randrange(10)
    Image.fromarray(_picture(9, 9)).save(path, exif=exif)
    return "EXIF orientation"


def _copied(path: Path, rng: random.Random) -> str:
    """Another file of the capture under this name."""
    others = sorted(other for other in path.parent.rglob("*") if other.is_file() and other != path)
    other = rng.choice(others)
    shutil.copyfile(other, path)
    return f"is a copy of {other.name}"


def _some(path: Path, suffix: str, rng: random.Random) -> Path:
    """The path, or one of its capture with that suffix."""
    folder = next(parent for parent in path.parents if parent.name.startswith("case-"))
    found = sorted(folder.rglob(f"*{suffix}"))
    return rng.choice(found) if found else path


_SPECIAL: tuple[Callable[[Path, random.Random], str], ...] = (_huge_jpeg, _playlist, _turned, _copied)


# ---------------------------------------------------------------- one case


def run_case(case: Case) -> Outcome:
    """Damage a capture as index and seed say, look at it as a user would, and decode from it."""
    rng = random.Random(f"{case.seed}:{case.index}")
    pristine = case.work_dir / "pristine"
    if not pristine.is_dir():
        make_video_capture(pristine / "videos")
        make_panoptic_capture(pristine / "images")
        os.environ["XDG_DATA_HOME"] = str(case.work_dir / "data")
        _inspect(pristine / "videos")  # what loads at the first use is not the case's memory
        watch_files([case.work_dir])
    folder = case.work_dir / f"case-{case.index}"
    shutil.copytree(pristine / rng.choice(("videos", "images")), folder)
    what, n_bytes = damage(folder, rng)
    take_outside()
    verdict, detail = _look(folder)
    outside = take_outside()
    if outside:
        verdict, detail = "outside", ", ".join(outside)
    shutil.rmtree(folder)
    return Outcome(what, verdict, detail, n_bytes)


def _look(folder: Path) -> tuple[str, str]:
    from engine.capture.capture import open_capture

    code, out, err = _inspect(folder)
    if code not in (0, 2) or "Traceback" in err or "bug in the program" in err or "Warning" in err:
        return "untyped", f"exit {code}: {err[-300:]}"
    if code == 2:
        is_one_message = err.startswith("clipgstream: ") and err.count("clipgstream: ") == 1
        return ("typed", err) if is_one_message else ("untyped", f"not one message: {err[-300:]}")
    try:
        json.loads(out, parse_constant=_refuse)
        out.encode("ascii")
    except ValueError as error:
        return "untyped", f"inspect --json: {error}"

    def decode() -> None:
        capture = open_capture(folder)
        for camera in range(len(capture.rig)):
            for frame in (0, capture.n_frames - 1):
                assert capture.frame(camera, frame).dtype == np.uint8
        capture.close()

    return judge(decode)


def _inspect(folder: Path) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of `clipgstream inspect --json`."""
    from app.cli.cli import main

    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(["inspect", str(folder), "--json", "--quick"])
        if code == 0:
            code = main(["inspect", str(folder), "--quick"])
    text = out.getvalue()
    end = text.find("\n}\n")
    return code, text[: end + 3], err.getvalue()


def _refuse(text: str) -> float:
    raise ValueError(f"{text} is not JSON")


if __name__ == "__main__":
    sys.exit(fuzz_main("fuzz_capture", __doc__ or "", run_case))
