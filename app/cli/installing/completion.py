"""Completion for shells: a script with every command, option and choice, as the parsers declare them.

The script is complete in itself: a press of Tab starts no program. What it does not know, such as a path, the shell
completes as ever.
"""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from app.cli.arguments import PlainParser

SHELLS = ("bash", "zsh", "fish")

_FIRST_PLACE = 1
"""Where the command stands; the program is 0. After a verb, at 3, places are counted from 4."""


@dataclass(frozen=True, slots=True)
class KnownWords:
    """The words that may stand in one place of a line.

    Attributes:
        after: What stands before: the command, then its verb if it has any; empty for the window.
        place: Number of the word, from 1 for the command; None for a value.
        option: Whose value it is; empty for a place.
        words: What may stand there, with the purpose where that is known. None of them for what the shell completes.
    """

    after: tuple[str, ...]
    place: int | None
    option: str
    words: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class KnownOptions:
    """The options behind a command or its verb: whether each takes a value, and its purpose."""

    after: tuple[str, ...]
    options: Mapping[str, tuple[bool, str]]


def completion_script(shell: str, parsers: Mapping[str, PlainParser], summaries: Mapping[str, str]) -> str:
    """The text that a shell reads.

    Args:
        shell: One of SHELLS.
        parsers: By command; that of the window under "".
        summaries: Purposes of the commands.
    """
    known = list(_known(parsers, summaries))
    if shell == "fish":
        return _fish(known)
    return (_ZSH if shell == "zsh" else "") + _bash(known)


def _known(parsers: Mapping[str, PlainParser], summaries: Mapping[str, str]) -> Iterator[KnownWords | KnownOptions]:
    yield KnownWords((), _FIRST_PLACE, "", summaries)
    for name, parser in parsers.items():
        after = (name,) if name else ()
        yield from _of_parser(parser, after, len(after) + 1)
        if parser.verbs:
            yield KnownWords(after, 3, "", {verb: one.description or "" for verb, one in parser.verbs.items()})
            for verb, one in parser.verbs.items():
                yield from _of_parser(one, (name, verb), 4)


def _of_parser(
    parser: argparse.ArgumentParser, after: tuple[str, ...], place: int
) -> Iterator[KnownWords | KnownOptions]:
    options: dict[str, tuple[bool, str]] = {}
    for action in parser._actions:
        words = {str(choice): "" for choice in action.choices or ()}
        if not action.option_strings:
            if words:
                yield KnownWords(after, place, "", words)
            place += 1
        elif action.help is not argparse.SUPPRESS:
            about = parser._get_formatter()._expand_help(action) if action.help else ""
            for option in action.option_strings:
                options[option] = action.nargs != 0, about
                if action.nargs != 0:
                    yield KnownWords(after, None, option, words)
    yield KnownOptions(after, options)


# ---- bash, and zsh through its own bashcompinit -----------------------------------------------------------------

_ZSH = """\
# clipgstream completion for zsh
(( $+functions[compdef] )) || { autoload -Uz compinit && compinit }
autoload -Uz bashcompinit && bashcompinit
"""

_BASH = """\
# clipgstream completion for bash: `completion bash` of the program wrote it
_clipgstream_words() {{ # the words after a line's command and verb, at a place, of an option, or the options: "--"
    case "$1" in
{cases}
        *) return 1 ;;
    esac
}}
_clipgstream() {{
    local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} after=${{COMP_WORDS[1]}} words
    if [ "$word" = = ]; then word=''; elif [ "$before" = = ]; then before=${{COMP_WORDS[COMP_CWORD-2]}}; fi
    if [ "$COMP_CWORD" -eq 1 ] || ! _clipgstream_words "$after --" >/dev/null; then after=''; fi
    if [ "$COMP_CWORD" -gt 3 ] && _clipgstream_words "$after ${{COMP_WORDS[3]}} --" >/dev/null; then
        after="$after ${{COMP_WORDS[3]}}"
    fi
    case "$before" in
        -*) words=$(_clipgstream_words "$after $before") && {{ _clipgstream_offer; return; }} ;;
    esac
    case "$word" in
        -*) words=$(_clipgstream_words "$after --") ;;
        *) words=$(_clipgstream_words "$after $COMP_CWORD") ;;
    esac
    _clipgstream_offer
}}
_clipgstream_offer() {{ COMPREPLY=($(compgen -W "$words" -- "$word")); }}
complete -o default -F _clipgstream clipgstream
"""


def _bash(known: list[KnownWords | KnownOptions]) -> str:
    cases = []
    for one in known:
        where = "--" if isinstance(one, KnownOptions) else one.option or str(one.place)
        words = one.options if isinstance(one, KnownOptions) else one.words
        key = shlex.quote(f"{' '.join(one.after)} {where}")
        cases.append(f"        {key}) echo {shlex.quote(' '.join(words))} ;;")
    return _BASH.format(cases="\n".join(cases))


# ---- fish -------------------------------------------------------------------------------------------------------

_FISH = """\
# clipgstream completion for fish: `completion fish` of the program wrote it
function __clipgstream_after
    set -l words (commandline -opc)
    test (count $argv) -eq 0; and not contains -- "$words[2]" {commands}; and return 0
    test (count $argv) -ge 1; and test "$words[2]" = "$argv[1]"; or return 1
    test (count $argv) -eq 1; or test "$words[4]" = "$argv[2]"
end
function __clipgstream_at
    test (count (commandline -opc)) -eq $argv[1]; and __clipgstream_after $argv[2..]
end
"""


def _fish(known: list[KnownWords | KnownOptions]) -> str:
    commands = sorted({one.after[0] for one in known if one.after})
    lines = [_FISH.format(commands=" ".join(commands))]
    values = {(one.after, one.option): one.words for one in known if isinstance(one, KnownWords) and one.option}
    for one in known:
        if isinstance(one, KnownOptions):
            condition = _quoted(" ".join(("__clipgstream_after", *one.after)))
            for option, (takes_value, about) in one.options.items():
                kind = "-l" if option.startswith("--") else "-s"
                words = values.get((one.after, option), {})
                value = f" -x -a {_quoted(' '.join(words))}" if words else " -r" if takes_value else ""
                lines.append(f"{_START} -n {condition} {kind} {option.lstrip('-')}{value} -d {_quoted(about)}\n")
        elif not one.option:
            condition = _quoted(" ".join(("__clipgstream_at", str(one.place), *one.after)))
            files = "" if one.place == _FIRST_PLACE else " -f"  # a capture may stand in place of a command
            lines += [
                f"{_START} -n {condition}{files} -a {_quoted(word)} -d {_quoted(about)}\n"
                for word, about in one.words.items()
            ]
    return "".join(lines)


_START = "complete -c clipgstream"


def _quoted(text: str) -> str:
    """As fish reads it, on one line."""
    return "'" + " ".join(text.split()).replace("\\", "\\\\").replace("'", "\\'") + "'"
