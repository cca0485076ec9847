"""clipgstream object: the objects of a project, listed, made, corrected, and found in its clips."""

from __future__ import annotations

import argparse
from typing import Any

from app.cli.arguments import EXIT_OK, parse_range, path_argument
from app.cli.projects.editing.edit_arguments import add_pick_arguments, chosen_picks
from app.cli.terminal.progress import ProgressLine
from app.document.changes.object_words import confidence_text, runs_within, seen_text
from app.document.changes.reach_words import frames_text
from app.scripting.scripted_project import ScriptedProject, open_scripted
from app.training.service import Launch
from engine.editing.picks import n_rows
from engine.editing.reach import Frames, unsearched
from engine.editing.scene_object import SceneObject
from engine.errors import EngineError, ProjectError
from engine.storage.json_files import json_text
from engine.text import one_line

OBJECT_SCHEMA = 1
PICKING = ("add", "correct")
ACTS = {
    "list": "",
    "add": "NAME --at FRAME --box, --sphere or --where: make an object of Gaussians of one frame",
    "correct": "NAME --at FRAME ... [--remove]: what is picked belongs to it as well, or does not",
    "find": "NAME: look for it in all clips again",
    "rename": "NAME NEW",
    "span": "NAME A:B: the frames in which it exists, B not included",
    "train": "NAME on|off: whether clips trained again see it; it is masked where it was found",
    "remove": "NAME: remove it, and the edits that act on it",
}


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream object`."""
    command.add_argument("project", type=path_argument, help="project folder")
    acts = "; ".join(f"{name} {words}".strip() for name, words in ACTS.items())
    command.add_argument("act", nargs="?", choices=tuple(ACTS), default="list", metavar="ACT", help=acts)
    command.add_argument("name", nargs="?", metavar="NAME", help="the object, by name or number")
    command.add_argument("value", nargs="?", metavar="VALUE", help="of rename, span and train")
    group = command.add_argument_group("what add and correct pick")
    add_pick_arguments(group)
    belongs = group.add_mutually_exclusive_group()
    belongs.add_argument("--add", action="store_true", help="correct: it belongs to the object (default)")
    belongs.add_argument("--remove", action="store_true", help="correct: it does not belong to the object")
    command.add_argument("--json", action="store_true", help="print the objects as JSON")
    command.add_argument("--quiet", action="store_true", help="show no progress")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream object: make the requested change, then list the objects. Returns the exit code."""
    _check_options(options)
    with open_scripted(options.project, read_only=options.act == "list", launch=launch) as project:
        if options.act != "list":
            _change(options, project)
        if options.json:
            print(json_text(describe_objects(project), indent=1))
        else:
            print("\n".join(object_lines(project)))
    return EXIT_OK


def _check_options(options: argparse.Namespace) -> None:
    """A given option that would be ignored is an error, and a missing one too."""
    act = options.act
    takes = {"name": act != "list", "value": act in ("rename", "span", "train")}
    for what, is_taken in takes.items():
        given = getattr(options, what)
        if is_taken and not given:
            raise ProjectError(f"{act} needs a {what}.", hint=f"Write: {act} {ACTS[act]}.")
        if given is not None and not is_taken:
            raise ProjectError(f"{act} does not take '{given}'.", hint=f"Write: {act} {ACTS[act]}".strip() + ".")
    picks = {"--at": options.at, "--box": options.box, "--sphere": options.sphere, "--where": options.where}
    picks |= {"--turned-box": options.turned_box, "--add": options.add or None, "--remove": options.remove or None}
    given = [name for name, value in picks.items() if value is not None]
    if given and act not in PICKING:
        raise ProjectError(f"{given[0]} is given with {act}.", hint="It goes with add and correct.")
    if act == "add" and options.remove:
        raise ProjectError("--remove is given with add.", hint="It goes with correct.")


def _change(options: argparse.Namespace, project: ScriptedProject) -> None:
    line = ProgressLine(is_quiet=options.quiet or options.json)
    name = options.name
    said = one_line(name)

    def tell(done: float) -> None:
        line.update(f"{'Masking' if options.act == 'train' else 'Finding'} {said}", done)

    match options.act:
        case "add":
            frame_index, picked = chosen_picks(options, project)
            project.make_object(name, picked, frame_index, on_progress=tell)
        case "correct":
            project.object(name)  # before anything is selected
            frame_index, picked = chosen_picks(options, project)
            parts = {"removed": picked} if options.remove else {"added": picked}
            project.correct_object(name, frame_index, on_progress=tell, **parts)
        case "find":
            project.find_object(name, on_progress=tell)
        case "rename":
            project.rename_object(name, options.value)
        case "span":
            project.object(name)  # before its frames
            project.set_object_span(name, *_span(options.value, project.n_frames))
        case "train":
            if options.value not in ("on", "off"):
                raise ProjectError(f"'{options.value}' is neither on nor off.")
            project.set_object_trained(name, is_trained=options.value == "on", on_progress=tell)
        case _:
            project.remove_object(name)
    line.finish()


def _span(text: str, n_frames: int) -> tuple[int, int | None]:
    found = parse_range(text, n_frames, option="span", what="frames")
    return found.start, None if text.strip().endswith(":") else found.stop


def describe_objects(project: ScriptedProject) -> dict[str, Any]:
    """The objects as plain data: schema; path; objects with id, name, color, seeds as frames, span, trained, unsearched
    (runs of frames), and clips with their frames, n_gaussians, seen, confidence and doubt."""
    missing = _unsearched(project)
    return {
        "schema": OBJECT_SCHEMA,
        "path": str(project.folder),
        "objects": [
            {
                "id": one.object_id,
                "name": one.name,
                "color": list(one.color),
                "seeds": [seed.frame_index for seed in one.seeds],
                "first": one.first,
                "stop": one.stop,
                "trained": one.is_trained,
                "unsearched": [list(run) for run in missing[one.object_id]],
                "clips": [
                    {
                        "start": clip.start,
                        "stop": clip.stop,
                        "n_gaussians": sum(n_rows(part.rows) for part in clip.sets),
                        "seen": [list(run) for run in clip.seen],
                        "confidence": clip.confidence,
                        "doubt": clip.doubt,
                    }
                    for clip in one.clips
                ],
            }
            for one in project.objects
        ],
    }


def object_lines(project: ScriptedProject) -> list[str]:
    """The same as text."""
    objects, missing = project.objects, _unsearched(project)
    lines = [f"{project.folder}: {len(objects)} object{'' if len(objects) == 1 else 's'}"]
    for one in objects:
        words = [seen_text(one), confidence_text(one)]
        words += [f"not looked at in {frames_text(missing[one.object_id])}"] if missing[one.object_id] else []
        words += [] if one.is_trained else ["left out of training"]
        lines.append(f"{one.object_id:>5}  {one_line(one.name)}: {', '.join(filter(None, words))}")
    return lines


def _unsearched(project: ScriptedProject) -> dict[int, Frames]:
    def runs(one: SceneObject) -> Frames:
        return runs_within(one, ((clip.start, clip.stop) for clip in unsearched(one, clips)))

    try:
        clips = project.anchors
    except EngineError:  # of a damaged clip nothing is known
        clips = ()
    return {one.object_id: runs(one) for one in project.objects}
