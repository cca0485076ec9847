"""Training settings on the command line: the arguments that choose them, and the list that --help-settings prints."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any

from engine.setting import value_text
from engine.training.config import SETTINGS, parse_overrides
from engine.training.presets import PRESETS, preset

WIDTH = 100


def add_training_settings(command: argparse.ArgumentParser) -> None:
    """Arguments of every subcommand that trains."""
    command.add_argument("--holdout", metavar="NAMES", help="cameras to leave out, or 'none' (default: the capture's)")
    command.add_argument("--scale", type=float, help="working size, share of the original in (0, 1] (default: 1)")
    command.add_argument("--clip-length", type=int, metavar="M", help="frames per clip (default: 10)")
    command.add_argument("--preset", metavar="NAME", help=f"{', '.join(PRESETS)} (default: small)")
    command.add_argument(
        "--set",
        dest="assignments",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="change a training setting; may be given several times",
    )
    command.add_argument("--help-settings", action=SettingsHelp, help="list the training settings and exit")


def overrides_of(options: argparse.Namespace) -> dict[str, Any]:
    """Training settings of the arguments: the preset, and settings in addition to it."""
    return (preset(options.preset) if options.preset else {}) | parse_overrides(options.assignments)


class SettingsHelp(argparse.Action):
    """Prints all settings and ends the program, as --help does with the arguments."""

    def __init__(self, option_strings: Sequence[str], dest: str, **options: Any) -> None:
        super().__init__(option_strings, dest=argparse.SUPPRESS, default=argparse.SUPPRESS, nargs=0, **options)

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option_string: Any = None
    ) -> None:
        print("\n".join(settings_lines()))
        parser.exit()


def settings_lines() -> Iterator[str]:
    """The settings by group, each with a line to write it by and its meaning below."""
    for group, settings in groupby(SETTINGS.values(), key=lambda setting: setting.group):
        yield group
        for setting in settings:
            yield f"  {f'{setting.name}={value_text(setting.default)}':<34} {setting.span}"
            yield from _wrapped(setting.meaning, "      ")
            for choice, meaning in setting.choices.items():
                yield from _wrapped(f"{choice}: {meaning}", "        ")
        yield ""


def _wrapped(text: str, indent: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=indent)
