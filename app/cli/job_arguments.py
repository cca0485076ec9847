"""Options of export jobs on the command line, from the declarations of the jobs."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from typing import Any

from app.cli.arguments import parse_cameras, parse_range
from app.evaluation.headless import TrainedProject
from app.export.jobs.job import ExportJob
from app.export.picked_frames import PickedFrames, picked_frames
from engine.errors import ProjectError
from engine.setting import Flag, Setting, settings_of

_APART = ("format", "frames")
"""Asked for by the commands themselves."""
_Place = argparse._ActionsContainer


def add_job_arguments(command: argparse.ArgumentParser, jobs: Sequence[type[ExportJob]]) -> None:
    """Options of these jobs; what only one of several jobs takes stands in a group of its own."""
    done: set[str] = set(_APART)
    for job in jobs:
        own: _Place | None = None
        one_of: dict[str, _Place] = {}
        for name, setting in settings_of(job).items():
            if name in done:
                continue
            done.add(name)
            place: _Place = command
            if setting.one_of:
                if setting.one_of not in one_of:
                    one_of[setting.one_of] = command.add_mutually_exclusive_group(required=True)
                place = one_of[setting.one_of]
            elif len(jobs) > 1 and sum(other.takes(name) for other in jobs) == 1:
                place = own = own or command.add_argument_group(job.title)
            _add(place, setting, name)
            for inner in setting.inner.values():
                _add(command, inner, f"{name}.{inner.name}")


def _add(place: _Place, setting: Setting, dest: str) -> None:
    if len(setting.flags) > 1:
        place = place.add_mutually_exclusive_group()
    for flag in setting.flags:
        said: dict[str, Any] = {"dest": dest, "help": _help(setting, flag).replace("%", "%%")}
        if flag.constant is not None:
            place.add_argument(flag.name, action="store_const", const=flag.constant, **said)
            continue
        like = setting.writing.like.split() if setting.writing else [setting.like]
        if len(like) > 1:
            said |= {"nargs": len(like)}
        if like[0]:
            said |= {"metavar": tuple(like) if len(like) > 1 else like[0]}
        if setting.choices:
            known = [choice.removeprefix(flag.prefix) for choice in setting.choices if choice.startswith(flag.prefix)]
            said |= {"type": _with_prefix(flag.prefix, known), "metavar": "|".join(known)}
        elif setting.kind in (int, float):
            said = {"metavar": flag.name[2:].upper(), "type": setting.kind} | said
        place.add_argument(flag.name, **said)


def _with_prefix(prefix: str, known: Sequence[str]) -> Callable[[str], str]:
    def choice(text: str) -> str:
        if text not in known:
            raise argparse.ArgumentTypeError(f"invalid choice: {text!r} (choose from {', '.join(known)})")
        return prefix + text

    return choice


def _help(setting: Setting, flag: Flag) -> str:
    meaning = flag.meaning or setting.meaning
    choices = "".join(f"; {name}: {words}" for name, words in setting.choices.items() if words)
    is_first = flag is setting.flags[0]
    has_usual = is_first and setting.usual and not setting.one_of and (flag.constant is None or setting.default is None)
    return f"{meaning[0].lower()}{meaning[1:]}{choices}" + (f" (default: {setting.usual})" if has_usual else "")


def given_entries(
    options: argparse.Namespace, job: type[ExportJob], opened: TrainedProject | None = None
) -> dict[str, Any]:
    """Options given to a job, by name.

    Args:
        opened: Has the cameras that options name.
    Raises:
        ProjectError: Something was given that cannot be understood.
    """
    found = {name: _given(options, setting, name, opened) for name, setting in settings_of(job).items()}
    return {name: value for name, value in found.items() if name not in _APART and value is not None}


def _given(options: argparse.Namespace, setting: Setting, dest: str, opened: TrainedProject | None) -> Any:
    value = getattr(options, dest, None)
    if setting.writing is not None and value is not None:
        return setting.parse(value if isinstance(value, str) else " ".join(value))
    if setting.names == "cameras" and value is not None and opened is not None:
        return _camera(value, setting.flags[0].name, opened)
    inner = {
        name: part
        for name, one in setting.inner.items()
        if (part := _given(options, one, f"{dest}.{name}", opened)) is not None
    }
    if inner and value is None:
        flags = [one.flags[0].name for one in setting.inner.values()]
        said = f"{', '.join(flags[:-1])} and {flags[-1]} belong to {setting.flags[0].name}."
        raise ProjectError(said, hint="Leave them out.")
    return setting.kind(**inner) if inner else value


def check_given(options: argparse.Namespace, jobs: Sequence[type[ExportJob]], job: type[ExportJob]) -> None:
    """Check that nothing was given that would be passed over. Raises ProjectError."""
    unused = {
        setting.flag_of(value).name: None
        for other in jobs
        for name, value in given_entries(options, other).items()
        if not job.takes(name) and value != (setting := settings_of(other)[name]).default
    }
    if not job.takes("frames"):
        unused |= {f"--{name}": None for name in ("frames", "clip") if getattr(options, name) is not None}
        unused |= {"--step": None} if options.step != 1 else {}
    for flag in unused:
        raise ProjectError(f"{flag} does not apply to {options.format or job.kind}.", hint="Leave it out.")


def chosen_frames(options: argparse.Namespace, opened: TrainedProject) -> PickedFrames | None:
    """The frames of --frames, --clip and --step; None for all that are trained. Raises ProjectError where there are no
    such frames."""
    if options.step < 1:
        raise ProjectError(f"--step is {options.step}.", hint="Write 1 for every frame, 2 for every second one.")
    if options.clip is not None:
        if not 0 <= options.clip < len(opened.clips):
            hint = f"The project has clips 0 to {len(opened.clips) - 1}."
            raise ProjectError(f"There is no clip {options.clip}.", hint=hint)
        chosen = opened.clips[options.clip].frame_indices()
    elif options.frames is not None:
        return _frame_ranges(options, opened.capture.n_frames)
    elif options.step == 1:
        return None
    else:
        trained = [frame for i in sorted(opened.trained) for frame in opened.clips[i].frame_indices()]
        chosen = range(trained[0], trained[-1] + 1) if trained else range(0)
        if len(chosen) > len(trained):
            raise ProjectError(
                "--step is given without --frames, and clips between those that are trained are not.",
                hint="Say which frames: --frames A:B.",
            )
    return PickedFrames.of(range(chosen.start, chosen.stop, options.step))


def _frame_ranges(options: argparse.Namespace, n_frames: int) -> PickedFrames:
    """One range, or several that rise. Raises ProjectError."""
    spans: list[tuple[int, int]] = []
    for part in options.frames.split(","):
        chosen = parse_range(part, n_frames, option="--frames", what="frames")
        if spans and chosen.start < spans[-1][1]:
            raise ProjectError(f"--frames is '{options.frames}', whose ranges are not in order.")
        spans.append((chosen.start, chosen.stop))
    return picked_frames(spans, options.step)


def _camera(text: str, option: str, opened: TrainedProject) -> str:
    if text in opened.capture.rig.names:  # one name, whatever is in it
        return text
    chosen = parse_cameras(text, opened.capture)
    if len(chosen) != 1:
        raise ProjectError(f"{option} is '{text}'; one camera can be taken at a time.")
    return chosen[0]
