"""The commands and their options as sections, from the parsers that read them."""

from __future__ import annotations

import argparse

from app.cli.cli import parsers_of_commands
from tests.documents.table import table
from ui import main as window


def command_sections() -> str:
    """The window, the demo, then every command without a window: how it is called, what it does, its options."""
    parsers = [window.build_parser(), window.build_demo_parser(), window.build_completion_parser()]
    for parser in parsers_of_commands().values():
        parsers += [parser, *parser.verbs.values()]
    return "\n\n".join(map(_section, parsers))


def _section(parser: argparse.ArgumentParser) -> str:
    actions = [action for action in parser._actions if not isinstance(action, argparse._HelpAction)]
    needed = [_name(action) for action in actions if action.required or not action.option_strings]
    optional = [action for action in actions if action.option_strings]
    rows = [(f"`{_name(action)}`", parser._get_formatter()._expand_help(action)) for action in actions]
    call = " ".join([parser.prog, *needed] + (["[options]"] if len(optional) > len(needed) else []))
    return f"### `{call}`\n\n{parser.description}\n\n{table(('argument', 'means'), rows)}"


def _name(action: argparse.Action) -> str:
    """An argument as it is written: an option and its value, or a place in capitals, bracketed if optional."""
    if not action.option_strings:
        name = str(action.metavar or action.dest).upper()
        return name if action.required else f"[{name}]"
    value = action.metavar or ("|".join(map(str, action.choices)) if action.choices else action.dest.upper())
    values = " ".join(value) if isinstance(value, tuple) else value
    if action.nargs == 0:
        values = ""
    elif action.nargs == "+":
        values += " ..."
    return f"{action.option_strings[-1]} {values}".strip()
