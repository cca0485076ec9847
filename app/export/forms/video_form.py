"""What is asked for videos and sequences of pictures."""

from __future__ import annotations

from app.export.export_choices import ExportChoices, ExportContext
from app.export.export_jobs import Job
from app.export.forms.form import Answers, Form, Option

_FORMATS = (("mp4", "H.264 (.mp4)"), ("webm", "VP9 (.webm)"), ("png", "PNG files"), ("exr", "OpenEXR files"))
_SHOWS = (
    ("color", "Colour"),
    ("depth", "Depth"),
    ("opacity", "Opacity"),
    ("change", "Change"),
    ("compare", "Truth, render, error"),
)
_SHOWS_TIPS = {
    "depth": "Distance along the viewing axis",
    "opacity": "How much of what lies behind is covered",
    "change": "What differs from the moment before, seen from the same place",
    "compare": "What the camera took, the render, and the error between them, side by side",
}
_SIZES = (("1280x720", "1280 x 720"), ("1920x1080", "1920 x 1080"), ("3840x2160", "3840 x 2160"))
_RATES = (("24", "24"), ("25", "25"), ("30", "30"), ("50", "50"), ("60", "60"))
_SPEEDS = (("1", "As it happened"), ("0.5", "Half"), ("0.25", "A quarter"), ("0.125", "An eighth"), ("2", "Double"))
_TURNS = (("1", "One"), ("2", "Two"), ("3", "Three"), ("0.5", "Half a turn"), ("-1", "One, the other way round"))
_SUPERSAMPLING = (("1", "None"), ("2", "2 x 2"), ("3", "3 x 3"), ("4", "4 x 4"))
_BACKGROUNDS = {"black": (0, 0, 0), "grey": (128, 128, 128), "white": (255, 255, 255)}
CAMERA, PATH, TURNTABLE = "camera:", "path:", "turntable"
"""What answers to "from" begin with."""


def _options(context: ExportContext, choices: ExportChoices) -> tuple[Option, ...]:
    paths = [(PATH + name, f"Camera path: {name}") for name in context.paths]
    cameras = [(CAMERA + name, f"Camera {name}") for name in context.cameras]
    view = Option("from", "Seen from", (*paths, (TURNTABLE, "Turntable around the scene"), *cameras), has_names=True)
    format_ = Option("format", "Format", _FORMATS)
    chosen_format, is_camera = format_.chosen(choices), view.chosen(choices).startswith(CAMERA)
    shows = Option("shows", "Shows", _SHOWS if is_camera else _SHOWS[:-1], _SHOWS_TIPS)
    width, height = context.picture_size
    options = [format_, view, shows]
    if shows.chosen(choices) != "compare":
        sizes = [size for size in _SIZES if size[0] != f"{width}x{height}"]
        options.append(Option("size", "Size", (("", f"{width} x {height}"), *sizes)))
    if view.chosen(choices) == TURNTABLE:
        options.append(Option("turns", "Turns", _TURNS))
    options.append(Option("supersampling", "Smoothing", _SUPERSAMPLING))
    if not is_camera:
        still = f"Stands still at frame {context.frame_index}"
        options.append(Option("time", "Time", (("runs", "Runs"), ("still", still))))
    if shows.chosen(choices) != "compare":
        options.append(Option("speed", "Speed", _SPEEDS))
        rates = [rate for rate in _RATES if float(rate[0]) != context.fps]
        options.append(Option("fps", "Rate", (("", f"{context.fps:g} per second"), *rates)))
    if shows.chosen(choices) == "color":
        clear = (("clear", "Transparent"),) if chosen_format != "mp4" else ()
        names = tuple((name, name.capitalize()) for name in _BACKGROUNDS)
        options.append(Option("background", "Background", (*names, *clear)))
    if chosen_format in ("mp4", "webm") and context.has_videos:
        recorded = tuple((name, f"Camera {name}") for name in context.cameras)
        options.append(Option("sound", "Sound", (("", "None"), *recorded), has_names=True))
    return tuple(options)


def _suffix(answers: Answers) -> str:
    format_ = answers["format"]
    return f".{format_}" if format_ in ("mp4", "webm") else ""


def _job(answers: Answers) -> Job:
    from app.export.video.job import PASSES, Turntable, VideoJob

    view, size, rate, background = answers["from"], answers["size"], answers["fps"], answers["background"]
    frames, is_still = answers.frames, answers["time"] == "still"
    # a path knows for itself during which frames it moves; of a scene that stands still, frames are only a length of
    # time, which gaps between trained clips do not matter to
    has_own_frames = answers.choices.frames == "all" and (view.startswith(PATH) or not is_still)
    width, _, height = size.partition("x")
    return VideoJob(
        out=answers.out,
        format=answers["format"],
        camera=view.removeprefix(CAMERA) if view.startswith(CAMERA) else None,
        path=view.removeprefix(PATH) if view.startswith(PATH) else None,
        turntable=Turntable(float(answers["turns"])) if view == TURNTABLE else None,
        frames=None if has_own_frames or not frames else (frames[0], frames[-1] + 1),
        shows=answers.one_of(tuple(PASSES), "shows"),
        size=(int(width), int(height)) if size else None,
        fps=float(rate) if rate else None,
        speed=float(answers["speed"] or 1),
        hold=float(answers.context.frame_index) if is_still else None,
        supersampling=int(answers["supersampling"]),
        background=_BACKGROUNDS.get(background, (0, 0, 0)),
        is_transparent=background == "clear",
        sound=answers["sound"] or None,
        has_edits=answers.has_edits,
    )


VIDEO = Form(
    kind="video",
    about="A video or pictures from a camera of the capture, along a camera path, or all around the scene.",
    options=_options,
    suffix=_suffix,
    make_job=_job,
    has_step=False,
    needs_trained=False,
)
