"""VideoJob: a video, or a folder of pictures."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from app.export.jobs.job import EDITS, FRAMES, OBJECT, SOUND, TIMING, ExportJob, option
from app.export.jobs.question import Question
from app.export.picked_frames import PickedFrames
from app.export.video.formats import FORMATS
from engine.errors import ProjectError
from engine.setting import Declared, Flag, Writing

if TYPE_CHECKING:
    from app.export.jobs.answers import Answers

PassName = Literal["color", "depth", "opacity", "change", "compare"]
MAX_SIDE_PX, MAX_PIXELS = 16_384, 1 << 27
"""Of a picture as it is drawn, before it is reduced: as long as H.264 allows, and some gigabytes of memory."""
MAX_PICTURES = 1_000_000
VIEW, STILL, CLEAR = "from", "still", "clear"
"""The question where pictures are taken from, and answers that are not the value of one option."""
_BACKGROUNDS = {"#000000": "Black", "#808080": "Grey", "#ffffff": "White"}


def _read_size(text: str) -> tuple[int, int]:
    if (found := re.fullmatch(r"(\d{1,6})[xX×](\d{1,6})", text.strip())) is None:
        raise ValueError(text)
    return int(found[1]), int(found[2])


def _read_color(text: str) -> tuple[int, int, int]:
    if (found := re.fullmatch("#?" + 3 * "([0-9a-fA-F]{2})", text.strip())) is None:
        raise ValueError(text)
    red, green, blue = (int(part, 16) for part in found.groups())
    return red, green, blue


SIZE = Writing("WxH", "WIDTHxHEIGHT, such as 1280x720", _read_size, lambda size: f"{size[0]}x{size[1]}")
COLOR = Writing("#RRGGBB", "#RRGGBB, such as #ffffff", _read_color, lambda color: "#{:02x}{:02x}{:02x}".format(*color))


class Turntable(Declared, frozen=True):
    """A camera on a circle around what all cameras look at, with the up direction that they agree on.

    Seen from above, positive turns go counterclockwise. They count from the first picture to the one that would follow
    the last, so that whole turns make a loop.
    """

    n_turns: Annotated[
        float,
        option(
            "Turns of the turntable; negative ones reverse it",
            "Turns",
            low=-100.0,
            high=100.0,
            titles={"1": "One", "2": "Two", "3": "Three", "0.5": "Half a turn", "-1": "One, reversed"},
            flags=(Flag("--turns"),),
        ),
    ] = 1.0
    elevation_deg: Annotated[
        float,
        option(
            "Height of the turntable above the horizon, in degrees",
            "Elevation",
            low=-90.0,
            high=90.0,
            unit="degrees",
            titles={angle: f"{angle}°" for angle in ("20", "0", "10", "30", "45", "60", "90")},
            flags=(Flag("--elevation"),),
        ),
    ] = 20.0
    radius: Annotated[
        float | None,
        option(
            "Distance of the turntable from the centre, in scene units",
            "Distance",
            low=1e-9,
            high=1e9,
            unit="scene units",
            none="the mean distance of the cameras",
        ),
    ] = None


class VideoJob(ExportJob, frozen=True):
    """An export of a video to a file, or to the folder of a sequence."""

    kind: ClassVar[str] = "video"
    title: ClassVar[str] = "Video"
    about: ClassVar[str] = "A video or pictures from a camera of the capture, along a camera path, or around the scene."
    work: ClassVar[str] = "app.export.video.video_export"
    command: ClassVar[str] = "render"
    has_step: ClassVar[bool] = False

    format: Annotated[
        str, option("What is written", "Format", answers={name: (row.label, "") for name, row in FORMATS.items()})
    ] = "mp4"
    camera: Annotated[
        str | None,
        option(
            "Looks through a camera of the capture, in its colours",
            "Seen from",
            titles={"*": "Camera {}"},
            names="cameras",
            like="NAME",
            one_of=VIEW,
        ),
    ] = None
    path: Annotated[
        str | None,
        option(
            "Along a camera path of the project",
            "Seen from",
            titles={"*": "Camera path: {}"},
            names="paths",
            like="NAME",
            one_of=VIEW,
        ),
    ] = None
    turntable: Annotated[
        Turntable | None,
        option(
            "Circles around the scene",
            "Seen from",
            titles={"": "Turntable around the scene"},
            flags=(Flag("--turntable", constant=Turntable()),),
            one_of=VIEW,
        ),
    ] = None
    frames: Annotated[PickedFrames | None, FRAMES] = None
    shows: Annotated[
        PassName,
        option(
            "What pictures show",
            "Shows",
            answers={
                "color": ("Colour", ""),
                "depth": ("Depth", "distance along the viewing axis"),
                "opacity": ("Opacity", "how much of what lies behind is covered"),
                "change": ("Change", "what changed since the previous moment, seen from the same place"),
                "compare": (
                    "Truth, render, error",
                    "the captured picture, the render, and the error between them, side by side",
                ),
            },
            flags=(Flag("--show"),),
        ),
    ] = "color"
    size: Annotated[
        tuple[int, int] | None,
        option(
            "Width and height in pixels",
            "Size",
            low=1,
            high=MAX_SIDE_PX,
            none="as captured",
            titles={"": "{} x {}"} | {f"{w}x{h}": f"{w} x {h}" for w, h in ((1280, 720), (1920, 1080), (3840, 2160))},
            writing=SIZE,
        ),
    ] = None
    fps: Annotated[
        float | None,
        option(
            "Pictures per second; does not change how fast the scene plays",
            "Rate",
            low=0.1,
            high=1000.0,
            none="as captured",
            titles={"": "{:.5g} per second"} | {rate: rate for rate in ("24", "25", "30", "50", "60")},
        ),
    ] = None
    speed: Annotated[
        float,
        option(
            "Playback speed of the scene; 0.25 is four times slower",
            "Speed",
            low=0.001,
            high=1000.0,
            titles={"1": "Normal", "0.5": "Half", "0.25": "A quarter", "0.125": "An eighth", "2": "Double"},
        ),
    ] = 1.0
    hold: Annotated[
        float | None,
        option(
            "Freezes the scene at this frame while the camera moves",
            "Time",
            titles={"": "Runs", STILL: "Frozen at frame {}"},
            like="FRAME",
        ),
    ] = None
    supersampling: Annotated[
        int,
        option(
            "Draws pictures this many times larger along both sides, then scales them down",
            "Smoothing",
            low=1,
            high=8,
            titles={"1": "None", "2": "2 x 2", "3": "3 x 3", "4": "4 x 4"},
            like="N",
        ),
    ] = 1
    background: Annotated[
        tuple[int, int, int],
        option("Colour behind the scene", "Background", low=0, high=255, titles=_BACKGROUNDS, writing=COLOR),
    ] = (0, 0, 0)
    is_transparent: Annotated[
        bool,
        option(
            "No background: keeps the opacity of the scene; OpenEXR always does",
            flags=(Flag("--transparent", constant=True),),
        ),
    ] = False
    sound: Annotated[str | None, SOUND] = None
    features: Annotated[
        Literal["both", "static", "dynamic"],
        option(
            "Shows only what the static or dynamic features of the anchors carry",
            "Features",
            answers={"both": ("Both", ""), "static": ("Static only", ""), "dynamic": ("Dynamic only", "")},
        ),
    ] = "both"
    has_edits: Annotated[bool, EDITS] = True
    object: Annotated[str | None, OBJECT] = None
    has_timing: Annotated[bool, TIMING] = True

    @classmethod
    def suffix(cls, format_name: str) -> str:
        """See `ExportJob`."""
        return next(iter(FORMATS[format_name].suffixes), "")

    @classmethod
    def asked(cls, questions: dict[str, Question], answers: Answers) -> dict[str, Question]:
        """One question for the three options that say where from, and none about what does not go together."""
        context, choices = answers.context, answers.choices
        seen_from = [questions.pop(name) for name in ("path", "turntable", "camera")]
        views = [(f"{one.name}:{text}" if text else one.name, words) for one in seen_from for text, words in one.values]
        view = Question(VIEW, "Seen from", tuple(views), has_names=True)
        kind, _, _ = view.chosen(choices).partition(":")
        if kind != "turntable":
            for name in Turntable.__struct_fields__:
                del questions[name]
        shows, kind_of_file = questions["shows"], FORMATS[questions["format"].chosen(choices)]
        if kind == "camera":
            del questions["hold"]
        else:
            shows = questions["shows"] = replace(shows, values=shows.values[:-1])
            (runs, still) = questions["hold"].values
            stands = (STILL, still[1].format(context.frame_index))
            questions["hold"] = replace(questions["hold"], values=(runs, stands))
        if shows.chosen(choices) == "compare":
            for name in ("size", "speed", "fps"):
                del questions[name]
        else:
            questions["size"] = _without(questions["size"], *context.picture_size)
            questions["fps"] = _without(questions["fps"], context.fps)
        if shows.chosen(choices) != "color":
            del questions["background"]
        elif kind_of_file.can_be_transparent:
            question = questions["background"]
            questions["background"] = replace(question, values=(*question.values, (CLEAR, "Transparent")))
        if kind_of_file.sound_codec is None or not context.has_videos:
            del questions["sound"]
        return {"format": questions.pop("format"), VIEW: view, **questions}

    @classmethod
    def entries(cls, answers: Answers) -> dict[str, Any]:
        """See `asked`."""
        kind, _, name = answers[VIEW].partition(":")
        entries: dict[str, Any] = {kind: answers.part(Turntable) if kind == "turntable" else name}
        is_still = answers["hold"] == STILL
        entries |= {"hold": float(answers.context.frame_index)} if is_still else {}
        # a path knows for itself during which frames it moves; of a scene that stands still, frames are only a length
        # of time, which gaps between trained clips do not matter to
        has_own_frames = answers.choices.frames == "all" and (kind == "path" or not is_still)
        frames = answers.frames
        entries["frames"] = None if has_own_frames or not frames else PickedFrames.of(range(frames[0], frames[-1] + 1))
        is_clear = answers["background"] == CLEAR
        return entries | ({"background": (0, 0, 0), "is_transparent": True} if is_clear else {})

    def check(self) -> None:
        """Check that its entries go together, whatever the project.

        Raises:
            ProjectError: Two of them do not.
        """
        kind = FORMATS[self.format]
        if sum(view is not None for view in (self.camera, self.path, self.turntable)) != 1:
            raise ProjectError(
                "Pictures are taken from a camera, along a path or on a turntable: give one of these three."
            )
        if self.frames is not None and (self.frames.step != 1 or len(self.frames.runs) != 1):
            raise ProjectError("A video has frames without gaps, at least one.", hint="Give a range without step.")
        if self.turntable is not None and not self.turntable.n_turns:
            raise ProjectError("A turntable of 0 turns does not move.", hint="Give a number of turns, such as 1.")
        if self.is_transparent and not kind.can_be_transparent:
            others = ", ".join(name for name, other in FORMATS.items() if other.can_be_transparent)
            raise ProjectError(f"{kind.label} has no transparency.", hint=f"Formats that have it are {others}.")
        if self.is_transparent and self.shows != "color":
            raise ProjectError("Only pictures in colour can be transparent.", hint="Leave one of the two out.")
        if self.format == "exr" and self.background != (0, 0, 0):
            raise ProjectError(
                "OpenEXR files keep the opacity of the scene and have no background.",
                hint="Leave the background out.",
            )
        if self.sound is not None and kind.sound_codec is None:
            raise ProjectError(f"{kind.label} cannot hold sound.", hint="Write an mp4 or a webm file.")
        if self.shows == "compare" and (self.camera is None or self.hold is not None):
            raise ProjectError(
                "Side by side with the truth needs a camera of the capture, frame by frame.",
                hint="Look through a camera, and leave the hold out.",
            )
        if self.shows == "compare" and self.size is not None:
            raise ProjectError(
                "Side by side, pictures have the size of the captured pictures.", hint="Leave the size out."
            )
        if self.shows == "compare" and self.format == "exr":
            raise ProjectError("OpenEXR cannot hold three pictures side by side.", hint="Write PNG files.")


def _without(question: Question, *values: float) -> Question:
    """The capture's own value by its words, and not once more among the others."""
    (usual, words), *others = question.values
    own = words.format(*values)
    different = (other for other in others if other[1] != own.removesuffix(" per second"))
    return replace(question, values=((usual, own), *different))
