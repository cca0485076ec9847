"""clipgstream edit: the stack of edits of a project, listed and changed, and the history of its document."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from msgspec import structs, to_builtins

from app.cli.arguments import EXIT_OK, path_argument
from app.cli.projects.editing import fill_verb
from app.cli.projects.editing.copy_verbs import COPY_VERBS, add_copy_verbs, run_copy_verb
from app.cli.projects.editing.edit_arguments import (
    add_edit_arguments,
    chosen_action,
    chosen_scope,
    chosen_target,
    has_action,
    has_scope,
    has_target,
)
from app.cli.projects.editing.edit_timing import add_time_arguments, change_time, given_time_options, take_lines
from app.cli.projects.editing.edit_verbs import VERBS, add_verb_arguments, check_words, take_verb
from app.cli.projects.editing.follow_verb import FOLLOW, MEANING, add_follow_arguments, take_follow
from app.cli.terminal.progress import ProgressLine
from app.document.changes.edit_changes import edit_with
from app.document.changes.edit_words import edit_title
from app.document.changes.fill_words import fill_text
from app.document.changes.reach_words import acting_text, reach_note
from app.document.changes.timing_changes import TIME_EDITS
from app.document.storing.stored_document import ENTRIES
from app.scripting.scripted_project import ScriptedProject, open_scripted
from app.training.service import Launch
from engine.editing.edit import Edit
from engine.errors import ProjectError
from engine.storage.json_files import JsonError, json_text, parse_json
from engine.text import one_line

EDIT_SCHEMA = 1
MAX_STDIN_CHARACTERS = 1 << 28
_OF_STACK = ("on", "off", "remove", "rename", "move_to", "replace", "fill", "put", "undo", "redo", "apply_permanently")


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream edit`."""
    command.add_argument("project", type=path_argument, help="project folder")
    verbs = {name: verb.meaning for name, verb in VERBS.items()} | {FOLLOW: MEANING}
    verbs |= {name: verb.help for name, verb in COPY_VERBS.items()}
    own_help = f"options of {', '.join(COPY_VERBS)}: clipgstream edit PROJECT VERB --help"
    command.add_argument(
        "words",
        nargs="*",
        metavar="VERB",
        help=f"what to do: {'; '.join(f'{name}: {words}' for name, words in verbs.items())}; "
        f"{', '.join(TIME_EDITS)}: see time, below; {own_help}",
    )
    add_verb_arguments(command)
    add_follow_arguments(command)
    add_edit_arguments(command)
    add_time_arguments(command)
    stack = command.add_argument_group("the stack and the history")
    one = stack.add_mutually_exclusive_group()
    one.add_argument("--on", type=int, metavar="ID", help="switch an edit on")
    one.add_argument("--off", type=int, metavar="ID", help="switch it off")
    one.add_argument("--remove", type=int, metavar="ID", help="remove it from the stack")
    one.add_argument("--rename", nargs=2, metavar=("ID", "NAME"), help="rename it")
    one.add_argument(
        "--move-to", nargs=2, type=int, metavar=("ID", "POSITION"), help="its place in the stack, 0 is the bottom"
    )
    one.add_argument("--replace", type=int, metavar="ID", help="change it: given options replace what it had")
    fill_verb.add_arguments(one)
    one.add_argument("--undo", type=int, nargs="?", const=1, metavar="N", help="undo the last step, or N steps")
    one.add_argument("--redo", type=int, nargs="?", const=1, metavar="N", help="redo the last undone step, or N steps")
    one.add_argument(
        "--put",
        metavar="JSON",
        help=f"entries of the document, which replace the present ones: {', '.join(ENTRIES)}; - reads them "
        "from standard input",
    )
    one.add_argument(
        "--apply-permanently",
        action="store_true",
        default=None,
        help="remove deleted anchors from the clips for good; earlier clips become versions",
    )
    stack.add_argument("--history", action="store_true", help="list the steps as well")
    command.add_argument("--json", action="store_true", help="print everything as JSON")
    add_copy_verbs(command)


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream edit: make the requested changes, then list the stack. Returns the exit code."""
    if options.verb is not None:
        print(run_copy_verb(options, launch))
        return EXIT_OK
    verb = options.words[0] if options.words else ""
    if take_follow(options):
        check_words(options, FOLLOW, "")
    elif verb in TIME_EDITS:
        return _run_verb(options, launch)
    else:
        take_verb(options)
    chosen = [name for name in (*_OF_STACK, "follow") if getattr(options, name) is not None]
    if len(chosen) > 1:
        raise ProjectError(f"--{chosen[0].replace('_', '-')} is given with follow.", hint="Leave one of them out.")
    is_new = not chosen and has_action(options)
    _check_options(options, chosen[0] if chosen else "")
    with open_scripted(options.project, read_only=not (chosen or is_new), launch=launch) as project:
        if is_new:
            _add(options, project)
        elif chosen:
            _change(options, project)
        found = describe_edits(project, has_steps=options.history)
        lines = [] if options.json else edit_lines(project, has_steps=options.history)
    print(json_text(found, indent=1) if options.json else "\n".join(lines))
    return EXIT_OK


def _run_verb(options: argparse.Namespace, launch: Launch) -> int:
    """A verb, such as `clipgstream edit PROJECT trim --frames 10:60`. Returns the exit code."""
    verb = options.words[0]
    check_words(options, verb, "by")
    of_edits = [name for name in _OF_STACK if getattr(options, name) is not None]
    frames, at = options.frames, options.at
    options.frames = options.at = None  # the verb's own
    if of_edits or has_action(options) or has_target(options) or has_scope(options) or options.name is not None:
        raise ProjectError(f"{verb} is given with options of edits.", hint="Leave them out.")
    options.frames, options.at = frames, at
    with open_scripted(options.project, launch=launch) as project:
        change_time(options, options.words, project)
        found = describe_edits(project, has_steps=options.history)
        lines = [] if options.json else edit_lines(project, has_steps=options.history)
    print(json_text(found, indent=1) if options.json else "\n".join(lines))
    return EXIT_OK


def _check_options(options: argparse.Namespace, chosen: str) -> None:
    """A given option that would be ignored is an error."""
    for flag in given_time_options(options):
        raise ProjectError(f"{flag} is given without a verb.", hint=f"Verbs are {', '.join(TIME_EDITS)}.")
    takes_edit = chosen in ("", "replace")
    given = {
        "what an edit does": has_action(options),
        "what an edit acts on": has_target(options),
        "frames": has_scope(options),
        "--name": options.name is not None,
    }
    for what, is_given in given.items():
        if is_given and not takes_edit:
            raise ProjectError(f"--{chosen.replace('_', '-')} is given with {what}.", hint="Leave one of them out.")
        if is_given and not chosen and not has_action(options):
            raise ProjectError("No edit is given.", hint="Give for instance --delete, or --replace ID to change one.")


def _add(options: argparse.Namespace, project: ScriptedProject) -> None:
    target = chosen_target(options, project, _text)
    action, inverts = chosen_action(options, target)
    scope = chosen_scope(options, project)
    is_inverted = options.inverted != inverts
    project.apply_edit(action, target, scope=scope, is_inverted=is_inverted, name=options.name or "", on_note=_say)


def _say(note: str) -> None:
    print(f"Note: {note}", file=sys.stderr)


def _change(options: argparse.Namespace, project: ScriptedProject) -> None:
    if options.on is not None:
        project.switch_edit(options.on, is_on=True)
    elif options.off is not None:
        project.switch_edit(options.off, is_on=False)
    elif options.remove is not None:
        project.remove_edit(options.remove)
    elif options.rename is not None:
        edit_id, name = options.rename
        if not edit_id.isdecimal():
            raise ProjectError(f"--rename is '{edit_id}', which is not the number of an edit.")
        project.rename_edit(int(edit_id), name)
    elif options.move_to is not None:
        project.move_edit(*options.move_to)
    elif options.replace is not None:
        project.replace_edit(_replaced(options, project), on_note=_say)
    elif options.fill is not None:
        fill_verb.run(options, project, _say)
    elif options.put is not None:
        _put(options.put, project)
    elif options.follow is not None:
        _follow(options, project)
    elif options.apply_permanently:
        project.apply_permanently()
    else:
        _take_steps(options, project)


def _follow(options: argparse.Namespace, project: ScriptedProject) -> None:
    line = ProgressLine(is_quiet=options.json)
    name, edit_id = options.follow
    project.follow_object(name, edit_id, on_progress=lambda done: line.update(f"Following {name}", done))
    line.finish()


def _take_steps(options: argparse.Namespace, project: ScriptedProject) -> None:
    is_undo = options.undo is not None
    n = options.undo if is_undo else options.redo
    n_known = len(project.history.past if is_undo else project.history.future)
    if not 1 <= n <= n_known:
        what = "undone" if is_undo else "redone"
        raise ProjectError(f"{n} steps cannot be {what}: there are {n_known}.")
    for _ in range(n):
        (project.undo if is_undo else project.redo)()


def _replaced(options: argparse.Namespace, project: ScriptedProject) -> Edit:
    edit = edit_with(project.document, options.replace)
    if has_target(options):
        edit = structs.replace(edit, target=chosen_target(options, project, _text), is_inverted=options.inverted)
    if has_action(options):
        action, inverts = chosen_action(options, edit.target)
        edit = structs.replace(edit, action=action, is_inverted=edit.is_inverted != inverts)
    if has_scope(options):
        edit = structs.replace(edit, scope=chosen_scope(options, project))
    if options.name is not None:
        edit = structs.replace(edit, name=options.name)
    return edit


def _put(text: str, project: ScriptedProject) -> None:
    try:
        entries = parse_json(_text(text))
    except JsonError as error:
        raise ProjectError(f"--put is not JSON: {error}.") from error
    if not isinstance(entries, dict) or not entries:
        raise ProjectError("--put is not an object with entries of the document.")
    project.put(entries)


def _text(argument: str) -> str:
    """An argument, or standard input where it is "-"."""
    if argument != "-":
        return argument
    text = sys.stdin.read(MAX_STDIN_CHARACTERS + 1)
    if len(text) > MAX_STDIN_CHARACTERS:
        raise ProjectError("Standard input is too long.")
    return text


def describe_edits(project: ScriptedProject, *, has_steps: bool = False) -> dict[str, Any]:
    """The stack as plain data: schema; path; edits, bottom first; timing, segments of the take; undo and redo, what
    each would do; with has_steps also past and future, names of steps, the next one last."""
    history, reaches = project.history, project.reaches
    found = {
        "schema": EDIT_SCHEMA,
        "path": str(project.folder),
        "edits": [
            _plain(edit)
            | {
                "title": edit_title(edit, project.document.objects),
                "acts": reaches[edit.edit_id].acts,
                "note": reach_note(reaches[edit.edit_id], edit.scope),
            }
            for edit in project.edits
        ],
        "timing": [to_builtins(one) for one in project.document.timing],
        "undo": history.undo_name,
        "redo": history.redo_name,
    }
    if has_steps:
        found |= {"past": [step.name for step in history.past], "future": [step.name for step in history.future]}
    return found


def _plain(edit: Edit) -> dict[str, Any]:
    """An edit as plain data; few have a fill."""
    plain = to_builtins(edit)
    if edit.fill is None:
        del plain["fill"]
    return plain


def edit_lines(project: ScriptedProject, *, has_steps: bool = False) -> list[str]:
    """The same as text."""
    edits, reaches = project.edits, project.reaches
    lines = [f"{project.folder}: {len(edits)} edit{'' if len(edits) == 1 else 's'}"]
    for edit in edits:
        state = "" if edit.is_on else " (off)"
        where = acting_text(edit.scope, reaches[edit.edit_id])
        lines.append(f"{edit.edit_id:>5}  {one_line(edit_title(edit, project.document.objects))}, {where}{state}")
        lines += [f"       {text}" for text in [fill_text(edit)] if text]
    lines += take_lines(project)
    if has_steps:
        history = project.history
        lines.append(f"Steps: {len(history.past)}")
        lines += [f"  {one_line(step.name)}" for step in history.past]
        lines += [f"  {one_line(step.name)} (undone)" for step in reversed(history.future)]
    return lines
