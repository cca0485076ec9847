"""Changes to the timing of a take. Each is declared here once, as a value: the window sends it as a command, scripts
and `clipgstream edit` make it of its entries, and `timing_changed` applies it to a document.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

from msgspec import NODEFAULT, to_builtins

from app.document.project_document import ProjectDocument
from engine.errors import ProjectError
from engine.setting import Declared, Flag, Writing, setting, settings_of
from engine.storage.typed_json import EntryError, to_type
from engine.text import shown
from engine.timing.cutting import Segments, Span, at_speed, cut_at, frozen, kept, looped, turned
from engine.timing.segment import MAX_FROZEN, MAX_REPEATS, MAX_SPEED, MIN_SPEED, Segment
from engine.timing.timing import check_length

_MAX_FRAME = 2**31 - 1


def _read_span(text: str) -> Span:
    first, stop = map(int, text.split(":"))
    return first, stop


def _read_places(text: str) -> tuple[int, ...]:
    return tuple(map(int, text.split(",")))


SPAN = Writing("A:B", "A:B, B not included", _read_span, lambda span: f"{span[0]}:{span[1]}")
PLACES = Writing(
    "N,N,...", "numbers of segments from 0 with commas", _read_places, lambda places: ",".join(map(str, places))
)
_FRAMES = setting("", "frames A up to B, B not included", low=0, high=_MAX_FRAME, none="all of the take", writing=SPAN)
_FRAME = setting("", "the frame", low=0, high=_MAX_FRAME)


class TimeEdit(Declared, frozen=True):
    """The base of changes of time. Raises ProjectError for a value that an entry may not have.

    Attributes:
        verb: Its name on the command line and in scripts; empty where only the window has it.
        meaning: Its effect, in a sentence.
    """

    verb: ClassVar[str] = ""
    meaning: ClassVar[str]

    @property
    def title(self) -> str:
        """As it can follow "Undo"."""
        raise NotImplementedError

    def applied(self, segments: Segments, n_frames: int) -> Segments:
        """The segments of the take after it.

        Args:
            segments: Before it; not none.
            n_frames: Of the capture.
        Raises:
            ProjectError, ValueError: It is not possible.
        """
        raise NotImplementedError


class Trim(TimeEdit, frozen=True):
    """Keep only some frames."""

    frames: Annotated[Span, _FRAMES]
    verb = "trim"
    meaning = "Keeps only these frames in the take"

    @property
    def title(self) -> str:
        return f"trim to {_words(self.frames)}"

    def applied(self, segments: Segments, n_frames: int) -> Segments:
        return kept(segments, _span(self.frames, n_frames))


class Split(TimeEdit, frozen=True):
    """Split what plays at a frame into two segments."""

    at: Annotated[int, _FRAME]
    verb = "split"
    meaning = "Splits the take where this frame begins"

    @property
    def title(self) -> str:
        return f"split at frame {self.at}"

    def applied(self, segments: Segments, n_frames: int) -> Segments:
        after = cut_at(segments, self.at)
        if after == segments:
            raise ProjectError(f"Nothing plays across the beginning of frame {self.at}.", hint="Choose another frame.")
        return after


class ChangeSpeed(TimeEdit, frozen=True):
    """Play frames slower or faster."""

    frames: Annotated[Span | None, _FRAMES] = None
    by: Annotated[float, setting("", "Speed; 0.5 is half as fast", low=MIN_SPEED, high=MAX_SPEED)] = 1.0
    to: Annotated[
        float | None,
        setting("", "Speed at the end, for a ramp", low=MIN_SPEED, high=MAX_SPEED, none="the same speed throughout"),
    ] = None
    ease: Annotated[
        Literal["linear", "smooth"],
        setting("", "How a ramp goes from one speed to the other", choices={"linear": "evenly", "smooth": "eased"}),
    ] = "linear"
    verb = "speed"
    meaning = "Plays frames slower or faster"

    @property
    def title(self) -> str:
        ramp = "" if self.to is None else f" to {self.to:g}"
        return f"speed {self.by:g}{ramp} of {_words(self.frames)}"

    def applied(self, segments: Segments, n_frames: int) -> Segments:
        end = self.by if self.to is None else self.to
        return at_speed(segments, _span(self.frames, n_frames), self.by, end, self.ease)


class Reverse(TimeEdit, frozen=True):
    """Play frames the other way round."""

    frames: Annotated[Span | None, _FRAMES] = None
    verb = "reverse"
    meaning = "Plays frames the other way round"

    @property
    def title(self) -> str:
        return f"reverse {_words(self.frames)}"

    def applied(self, segments: Segments, n_frames: int) -> Segments:
        return turned(segments, _span(self.frames, n_frames))


class Freeze(TimeEdit, frozen=True):
    """Hold a frame."""

    at: Annotated[int, _FRAME]
    n_output: Annotated[
        int, setting("", "Frames for which it is held", low=1, high=MAX_FROZEN, flags=(Flag("--for"),))
    ] = 30
    verb = "freeze"
    meaning = "Holds a frame"

    @property
    def title(self) -> str:
        return f"freeze frame {self.at}"

    def applied(self, segments: Segments, n_frames: int) -> Segments:
        _span((self.at, self.at + 1), n_frames)
        return frozen(segments, self.at, self.n_output)


class Loop(TimeEdit, frozen=True):
    """Play frames several times."""

    frames: Annotated[Span | None, _FRAMES] = None
    times: Annotated[int, setting("", "How often they are played; 1 ends a loop", low=1, high=MAX_REPEATS)] = 2
    crossfade: Annotated[
        int, setting("", "Frames in which the end fades into the beginning", low=0, high=MAX_FROZEN)
    ] = 0
    verb = "loop"
    meaning = "Plays frames several times"

    @property
    def title(self) -> str:
        return f"loop {_words(self.frames)}"

    def applied(self, segments: Segments, n_frames: int) -> Segments:
        return looped(segments, _span(self.frames, n_frames), self.times, self.crossfade)


class Order(TimeEdit, frozen=True):
    """Put segments in another order; those not named are left out, and one named twice is played twice."""

    places: Annotated[
        tuple[int, ...], setting("", "Segments in their new order", low=0, high=_MAX_FRAME, writing=PLACES)
    ]
    verb = "order"
    meaning = "Plays segments in this order; those not named are left out, one named twice is played twice"

    @property
    def title(self) -> str:
        return "order segments"

    def applied(self, segments: Segments, n_frames: int) -> Segments:
        wrong = [place for place in self.places if place >= len(segments)]
        if wrong or not self.places:
            what = f"There is no segment {wrong[0]}." if wrong else "No segment is named."
            raise ProjectError(what, hint=f"The take has segments 0 to {len(segments) - 1}.")
        return tuple(segments[place] for place in self.places)


class ResetTime(TimeEdit, frozen=True):
    """Play the take as captured again."""

    verb = "reset-time"
    meaning = "Plays the take as captured again"

    @property
    def title(self) -> str:
        return "reset the timing"

    def applied(self, segments: Segments, n_frames: int) -> Segments:
        return (Segment(0, n_frames),)


class ChangeSegment(TimeEdit, frozen=True):
    """Put a segment in the place of another one, as the fields of the window do.

    Attributes:
        place: Number of the segment, in output order.
        segment: The new one.
        gesture: See app.session.editing.edit_commands.
    """

    place: int
    segment: Segment
    gesture: int = 0
    meaning = "Changes a segment"

    @property
    def title(self) -> str:
        return f"change segment {self.place}"

    def applied(self, segments: Segments, n_frames: int) -> Segments:
        if not 0 <= self.place < len(segments):
            raise ProjectError(f"There is no segment {self.place}; segments are 0 to {len(segments) - 1}.")
        return (*segments[: self.place], self.segment, *segments[self.place + 1 :])


TIME_EDITS: dict[str, type[TimeEdit]] = {
    kind.verb: kind for kind in (Trim, Split, ChangeSpeed, Reverse, Freeze, Loop, Order, ResetTime)
}
"""By verb."""


def time_edit_called(verb: str, entries: Mapping[str, Any]) -> TimeEdit:
    """The change of a verb and its entries.

    Raises:
        ProjectError: There is no such verb or entry, or one is missing or out of range.
    """
    if verb not in TIME_EDITS:
        raise ProjectError(f"There is no change of time {shown(verb)}.", hint=f"Write {', '.join(TIME_EDITS)}.")
    kind, declared = TIME_EDITS[verb], settings_of(TIME_EDITS[verb])
    unknown = [name for name in entries if name not in declared]
    if unknown:
        known = f"It takes {', '.join(declared)}." if declared else "It takes none."
        raise ProjectError(f"{verb} has no entry {shown(unknown[0])}.", hint=known)
    missing = [one for one in declared.values() if one.default is NODEFAULT and one.name not in entries]
    if missing:
        raise ProjectError(f"{verb} needs {missing[0].flags[0].name}: {missing[0].meaning}.")
    values = {name: tuple(value) if isinstance(value, list) else value for name, value in entries.items()}
    return kind(**values)


def timing_changed(document: ProjectDocument, edit: TimeEdit, n_frames: int) -> ProjectDocument:
    """The document after a change of time.

    Args:
        n_frames: Of the capture.
    Raises:
        ProjectError: It is not possible, or the take would be too long.
    """
    whole = (Segment(0, n_frames),)
    try:
        segments = edit.applied(document.timing or whole, n_frames)
        segments = to_type(to_builtins(segments), tuple[Segment, ...])
        check_length(segments)
    except (EntryError, ValueError) as error:
        raise ProjectError(f"The take cannot be changed so ({error}).") from error
    return replace(document, timing=() if segments == whole else segments)


def segments_of(document: ProjectDocument, n_frames: int) -> Segments:
    """The segments of a document; one where the take is as captured. n_frames: Of the capture."""
    return document.timing or (Segment(0, n_frames),)


def segment_words(one: Segment) -> str:
    """A segment in words."""
    if one.n_frozen:
        return f"frame {one.first} frozen for {one.n_frozen} frame{'' if one.n_frozen == 1 else 's'}"
    words = [_words((one.first, one.stop))]
    if one.is_reversed:
        words.append("reversed")
    if one.start_speed != one.end_speed:
        words.append(f"speed {one.speed_at(0.0):.4g} to {one.speed_at(1.0):.4g}, {one.ease}")
    elif one.start_speed != 1.0:
        words.append(f"speed {one.start_speed:.4g}")
    if one.repeats > 1:
        frames = "1 frame" if one.crossfade_frames == 1 else f"{one.crossfade_frames} frames"
        words.append(f"{one.repeats} times" + (f", cross-fade of {frames}" if one.crossfade_frames else ""))
    return ", ".join(words)


def _span(frames: Sequence[int] | None, n_frames: int) -> Span:
    """Frames of the capture. Raises ProjectError where there are none."""
    if frames is None:
        return 0, n_frames
    first, stop = frames
    if not 0 <= first < stop <= n_frames:
        raise ProjectError(
            f"Frames {first}:{stop} are not in the capture.", hint=f"It has frames 0 to {n_frames - 1}: write A:B."
        )
    return first, stop


def _words(frames: Span | None) -> str:
    if frames is None:
        return "all frames"
    return f"frame {frames[0]}" if frames[1] == frames[0] + 1 else f"frames {frames[0]} to {frames[1] - 1}"
