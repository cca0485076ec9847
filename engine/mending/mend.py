"""Mending a stretch: ways to mend, cheapest first, each measured, and kept only where it helps and costs nothing.

Clips that others inherit from are never touched. All of it is judged by training cameras; held-out ones are reported.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from msgspec.structs import replace as with_entries

from engine.backends.backend import Backend
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.clip_files.clip_state import ClipState
from engine.clip_files.compact import CompactClip
from engine.errors import ProjectError
from engine.mending.diagnosis import SeamDiagnosis, diagnose
from engine.mending.figures import Attempt, StretchFigures
from engine.mending.measuring import StretchMeasuring, Threads
from engine.mending.remedies import MakeTraining, faded, relit
from engine.mending.stretch import Stretch
from engine.mending.targets import Looks
from engine.metrics.clips.trained_clip import TrainedClip
from engine.model.reading import load_clip_model
from engine.progress import Progress, ReportProgress

MEASURING, LIGHT, FADING, TRAINING = "Measuring", "Measuring light", "Fading", "Training"
_CLEAR_RATIO = 1.1
"""Of two clips whose mean squared errors on still parts differ by more, only the worse one changes."""
_SHARES = {"light": (0.1, 0.25), "fade": (0.3, 0.5), "joint": (0.55, 0.9)}
"""From where to where on the way each attempt reaches, as it is reported."""


@dataclass(frozen=True, slots=True)
class Mended:
    """The outcome of mending. A value.

    Attributes:
        stretch: The mended stretch.
        before, after: Figures; the same where nothing helped.
        attempts: All that was tried, in order.
        clips: The clips that changed, as they are stored.
        diagnosis: The parts that jump.
    """

    stretch: Stretch
    before: StretchFigures
    after: StretchFigures
    attempts: tuple[Attempt, ...]
    clips: dict[int, CompactClip]
    diagnosis: SeamDiagnosis

    @property
    def advice(self) -> str:
        """Another remedy, in a sentence; empty where enough was reached."""
        if self.after.is_enough(self.before):
            return ""
        worst = min(self.before.psnr, key=lambda index: self.before.psnr[index], default=None)
        which = "the clip" if worst is None else f"clip {worst}"
        return f"More than half of the excess flicker is left. Retrain {which}, perhaps with more steps."


class StretchMending:
    """Mends one stretch.

    Args:
        capture: At working size.
        stretch: The stretch to mend.
        clips: All clips of the capture.
        states: Finished clips by index: those of the stretch, and their neighbours where there are any.
        reference: The clip they inherit from.
        holdout: Camera indices that training never sees.
        make_training: Makes the training of a clip with some settings, not prepared.
        backend: The backend clips are decoded and drawn with.
        threads: How measuring is spread.
        report: Called with the progress; what it raises ends the work.

    Raises:
        ProjectError: A clip of the stretch is missing, or none of them may change, or cameras are not the capture's.
    """

    def __init__(
        self,
        capture: Capture,
        stretch: Stretch,
        clips: Sequence[Clip],
        states: Mapping[int, ClipState],
        reference: ClipState,
        *,
        holdout: Sequence[int],
        make_training: MakeTraining,
        backend: Backend,
        threads: Threads | None = None,
        report: ReportProgress = lambda progress: None,
    ) -> None:
        missing = [index for index in stretch.clip_indices if index not in states]
        if missing:
            raise ProjectError(f"Clip {missing[0]} is not trained.", hint="Train it before it is mended.")
        self._open = [index for index in stretch.clip_indices if not states[index].is_reference]
        if not self._open:
            raise ProjectError(
                "These frames are in the reference clip, which cannot change because others inherit from it.",
                hint="Retrain the reference clip, or mend the boundary to a neighbouring clip.",
            )
        self._capture, self._stretch, self._clips, self._reference = capture, stretch, list(clips), reference
        self._states, self._make, self._backend, self._report = dict(states), make_training, backend, report
        if unknown := set(reference.header.camera_names) - set(capture.rig.names):
            raise ProjectError(f"The capture has no camera {sorted(unknown)[0]}, which clips were trained with.")
        rows = {name: row for row, name in enumerate(capture.rig.names)}
        self._cameras = [rows[name] for name in reference.header.camera_names]
        seen = [camera for camera in self._cameras if camera not in capture.excluded_cameras]
        held_out = [camera for camera in holdout if camera not in capture.excluded_cameras]
        self._measuring = StretchMeasuring(capture, stretch, seen, held_out, threads)
        self._kept: dict[int, CompactClip] = {}
        self._shown = {index: self._trained(index, state) for index, state in states.items()}
        self._share = 0.0

    def run(self, method: str = "auto") -> Mended:
        """Mend.

        Args:
            method: "auto" tries one after the other until little is left; a name of METHODS tries that alone.
        Raises:
            EngineError: Pictures cannot be read, or a training came to nothing. Nothing is written anywhere.
        """
        self._say(MEASURING, 0.0, "how it is")
        before = best = self._measuring.measure(self._shown, with_held_out=True)
        if before.excess is None:
            raise ProjectError(
                "Nothing is static around these frames, so flicker cannot be measured.",
                hint="Choose other frames.",
            )
        found = diagnose(self._capture, self._shown, self._stretch, self._cameras)
        attempts: list[Attempt] = []
        for name, is_other in self._plan(method):
            if method == "auto" and (best.is_enough(before) or (name == "light" and not found.is_light_likely)):
                continue
            if is_other and best.is_enough(before):
                continue
            started_s = time.monotonic()
            words, tried = self._try(name, is_other=is_other)
            if not tried:
                continue
            shown = self._shown | {index: self._trained(index, clip.state) for index, clip in tried.items()}
            self._say(MEASURING, _SHARES[name][1], "what came of it")
            figures = self._measuring.measure(shown)
            is_kept = figures.is_better_than(best, before)
            attempts.append(Attempt(name, words, figures, is_kept, time.monotonic() - started_s))
            if is_kept:
                best, self._shown = figures, shown
                self._kept |= tried
                self._states |= {index: clip.state for index, clip in tried.items()}
        if self._kept:
            self._say(MEASURING, 0.95, "the result")
            best = self._measuring.measure(self._shown, with_held_out=True)
            self._kept = {
                index: _with_psnr(clip, best.held_out_psnr.get(str(index))) for index, clip in self._kept.items()
            }
        self._say(MEASURING, 1.0, "")
        return Mended(self._stretch, before, best if self._kept else before, tuple(attempts), self._kept, found)

    # ---------------------------------------------------------------- ways to mend

    def _plan(self, method: str) -> list[tuple[str, bool]]:
        """Attempts, in order: a way, and whether with the other clip, where one was tried and it did not suffice."""
        names = ["light", "fade", "joint"] if method == "auto" else [method]
        plan = [(name, False) for name in names]
        return [*plan, ("joint", True)] if "joint" in names and len(self._open) > 1 else plan

    def _try(self, name: str, *, is_other: bool) -> tuple[str, dict[int, CompactClip]]:
        if name == "light":
            return self._light()
        return self._fade() if name == "fade" else self._joint(is_other=is_other)

    def _light(self) -> tuple[str, dict[int, CompactClip]]:
        start, _ = _SHARES["light"]
        self._say(LIGHT, start, "exposure and light of the clips")
        tried = {}
        for index in self._open:
            clip = relit(self._states[index], self._reference, self._make)
            if clip is not None:
                tried[index] = clip
        return f"Exposure and light of {_named(tried)} were measured again", tried

    def _fade(self) -> tuple[str, dict[int, CompactClip]]:
        looks = self._looks()
        indices = self._moving(looks)
        frames = [frame for index in indices for frame in self._stretch.frames_in(self._clips[index])]
        span = range(min(frames), max(frames) + 1)
        tried = {}
        for i, index in enumerate(indices):
            report = self._part(FADING, "fade", i, len(indices), f"clip {index}")
            tried[index] = faded(self._states[index], self._clips[index], span, looks, self._make, report)
        whom = "each other" if len(tried) > 1 else "its neighbours"
        return f"{len(span)} frames of {_named(tried)} fade into {whom}", tried

    def _joint(self, *, is_other: bool) -> tuple[str, dict[int, CompactClip]]:
        looks = self._looks()
        index = self._worse_first(looks)[1 if is_other else 0]
        clip, report = self._clips[index], self._part(TRAINING, "joint", 0, 1, f"clip {index}")
        span = range(clip.start, clip.stop)
        tried = faded(self._states[index], clip, span, looks, self._make, report, is_learning=True)
        return f"Clip {index} was trained further, towards its pictures and its neighbours", {index: tried}

    def _looks(self) -> Looks:
        return Looks(self._capture, self._shown, self._cameras)

    def _moving(self, looks: Looks) -> list[int]:
        """Clips that fade: of two, one of which shows still parts much worse, that one."""
        if len(self._open) < 2:
            return self._open
        errors = looks.errors_across(self._clips[self._open[1]].start)
        is_clear = max(errors) > _CLEAR_RATIO * min(errors)
        return self._worse_first(looks)[:1] if is_clear else self._open

    def _worse_first(self, looks: Looks) -> list[int]:
        """Clips that may change; of two, the one first that shows still parts worse."""
        if len(self._open) < 2:
            return self._open
        before, after = looks.errors_across(self._clips[self._open[1]].start)
        return self._open if before > after else self._open[::-1]

    # ---------------------------------------------------------------- helpers

    def _trained(self, index: int, state: ClipState) -> TrainedClip:
        model = load_clip_model(state, self._reference, backend=self._backend)
        trained = TrainedClip.of_state(self._clips[index], model, state, self._reference)
        if trained is None:
            raise ProjectError(f"The file of clip {index} does not hold the colours of its cameras.")
        return trained

    def _part(self, stage: str, method: str, i: int, n: int, which: str) -> Callable[[int, int], None]:
        """Tells steps of the i-th of n clips."""
        start, stop = _SHARES[method]

        def report(step: int, n_steps: int) -> None:
            done = start + (stop - start) * (i + step / max(n_steps, 1)) / n
            self._say(stage, done, f"{which}, step {step} of {n_steps}")

        return report

    def _say(self, stage: str, done: float, message: str) -> None:
        self._share = max(self._share, done)
        self._report(Progress(stage, self._share, message))


def _with_psnr(clip: CompactClip, held_out_psnr: float | None) -> CompactClip:
    return clip.with_figures(with_entries(clip.state.header.figures, held_out_psnr=held_out_psnr, held_out_whole=True))


def _named(clips: Mapping[int, object]) -> str:
    numbers = " and ".join(str(index) for index in clips)
    return f"clip {numbers}" if len(clips) == 1 else f"clips {numbers}"
