"""Rules for our own source that no linter knows: no pickle, no eval, no network, no paths of one person's machine.

Each rule is shown to fail on a seeded sample, so that a green run means something.
"""

import ast
import re
import subprocess
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("app", "engine", "ui")

BANNED_MODULES = {
    # pickle, by any of its names: opening a file must never run code from it
    "pickle": "pickle",
    "cPickle": "pickle",
    "dill": "pickle",
    "joblib": "pickle",
    "marshal": "pickle",
    "shelve": "pickle",
    "multiprocessing": "pickle",  # it hands arguments and messages over as pickles: engine.children does without
    # network: the application works on local files and talks to nobody
    "aiohttp": "network",
    "ftplib": "network",
    "http": "network",
    "httpx": "network",
    "requests": "network",
    "smtplib": "network",
    "socket": "network",
    "socketserver": "network",
    "urllib": "network",
    "urllib3": "network",
    "webbrowser": "network",
    "xmlrpc": "network",
}
ALLOWED_USES = {
    "app/cluster/connecting.py": "imports socket (network)",  # asks whether anybody listens at the address of a cluster
}
"""What single files may do all the same: nothing connects that was not told an address on the command line."""
BANNED_CALLS = {"eval", "exec", "compile", "__import__"}
BANNED_ATTRIBUTES = {("torch", "save"), ("torch", "load"), ("os", "system"), ("os", "fork")}
BANNED_WORD = re.compile(
    rf"\b(?:{'|'.join([*BANNED_MODULES, *BANNED_CALLS, *(name for _, name in BANNED_ATTRIBUTES), 'allow_pickle'])})\b"
)
PUBLIC_CLASS = re.compile(r"^class ([A-Za-z]\w*)[(:\[]", re.MULTILINE)

MAX_FILES = 15
LARGE_FOLDERS = {
    "engine/capture/formats": "a reader per format: whoever adds one looks for the others in one place",
}
"""Folders that may hold more Python files, and why."""

# Home folders of people, the temporary folder, drive letters: text that works on one machine only.
MACHINE_PATH = re.compile(r"(?<![\w./~*-])(?:/(?:home|Users|root|tmp|work|mnt|media|scratch)/[\w.]|[A-Z]:\\\w)")
# Turns of phrase that are grammar but that nobody writes: "is no number" for "is not a number", "where nobody says".
_KEPT = "longer|more|larger|smaller|better|worse|other|different|faster|slower|wider|use|need|one|room|such"
ODD_ENGLISH = re.compile(
    rf"(?<!there )\b(?:is|are|was|were|be) no (?!(?:{_KEPT})\b)[a-z]"
    r"|\b(?:where|what|when) nobody (?:says|knows|named|chose)\b"
    r"|\bfailing is\b"
    r"|\b(?:is|are) (?:told|said) (?:at|in|of|that|to)\b",
    re.IGNORECASE,
)
# The same in what our source says, to users or in docstrings; docs/contributing.md has the cure for each.
_RUNS_ON = r"\bgo(?:es)? on (?:at|where|with|from|learning|until)\b"
ODD_WORDS = re.compile(
    r"\bwhat was learned\b"
    r"|\bmakes? no sense\b"
    r"|\btold apart\b"
    r"|\bthere is no [\w ]+ that could\b"
    r"|\bof (?:its|their) own accord\b"
    r"|\bfor reading only\b"
    r"|\bfault of the program\b"
    rf"|{_RUNS_ON}",
    re.IGNORECASE,
)
TEXT_SUFFIXES = {".py", ".md", ".toml", ".lock", ".sh", ".json", ".yml", ".yaml", ".txt", ".glsl", ".cfg", ".ini", ""}


def python_files() -> list[Path]:
    """Every source file of the application."""
    return sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))


def banned_uses(source: str) -> Iterator[str]:
    """Describe each banned import, call or attribute in `source`, as "line: what"."""
    if not BANNED_WORD.search(source):  # most files: parsing them takes seconds
        return
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Import(names=names):
                modules = [alias.name for alias in names]
            case ast.ImportFrom(module=str(module)):
                modules = [module]
            case ast.Call(func=ast.Name(id=name)) if name in BANNED_CALLS:
                yield f"{node.lineno}: {name}()"
                continue
            case ast.Attribute(value=ast.Name(id=owner), attr=attribute) if (owner, attribute) in BANNED_ATTRIBUTES:
                yield f"{node.lineno}: {owner}.{attribute}"
                continue
            case ast.keyword(arg="allow_pickle", value=ast.Constant(value=True)):
                yield f"{node.value.lineno}: allow_pickle=True"
                continue
            case _:
                continue
        for module in modules:
            if kind := BANNED_MODULES.get(module.split(".")[0]):
                yield f"{node.lineno}: imports {module} ({kind})"


def machine_paths(text: str) -> list[str]:
    """Lines of `text` that hold an absolute path of somebody's machine, as "line: text"."""
    return [f"{n}: {line.strip()}" for n, line in enumerate(text.splitlines(), 1) if MACHINE_PATH.search(line)]


def tracked_text_files() -> list[Path]:
    """Text files under version control; everything text-like below the root where there is no git."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False)
    if listed.returncode == 0 and listed.stdout:
        paths = [ROOT / name for name in listed.stdout.decode().split("\0") if name]
    else:
        paths = [path for package in (*PACKAGES, "tests") for path in (ROOT / package).rglob("*")]
    return [path for path in paths if path.suffix in TEXT_SUFFIXES and path.is_file()]


def test_our_code_uses_no_pickle_eval_or_network() -> None:
    files = python_files()
    assert len(files) > 20, "the packages were not found"
    used = [(path.relative_to(ROOT).as_posix(), use) for path in files for use in banned_uses(path.read_text("utf-8"))]
    found = [f"{name}:{use}" for name, use in used if not use.endswith(ALLOWED_USES.get(name, "\0"))]
    assert not found, "\n".join(found)
    assert {name for name, _ in used} == ALLOWED_USES.keys(), "an exception that nothing needs"


def test_ray_is_imported_by_app_cluster_alone_and_only_when_it_is_used() -> None:
    files = [
        path
        for path in python_files()
        if re.search(r"^\s*(?:import|from) ray\b", path.read_text("utf-8"), re.MULTILINE)
    ]
    assert {path.parent for path in files} == {ROOT / "app" / "cluster"}
    assert not [path for path in files if re.search(r"^(?:import|from) ray\b", path.read_text("utf-8"), re.MULTILINE)]


@pytest.mark.parametrize(
    "seeded",
    [
        "import pickle",
        "from pickle import loads",
        "import os, pickle as p",
        "def late():\n    import urllib.request",
        "from http.client import HTTPConnection",
        "import socket",
        "value = eval(text)",
        "exec(code)",
        "state = torch.load(path)",
        "torch.save(state, path)",
        "np.load(path, allow_pickle=True)",
        "os.fork()",
        "from multiprocessing.connection import Connection",
        "import multiprocessing as mp",
    ],
)
def test_rule_refuses_seeded_source(seeded: str) -> None:
    assert list(banned_uses(seeded))


@pytest.mark.parametrize(
    "innocent", ["model.eval()", "import re\nre.compile('x')", "np.load(path)", "import subprocess", "import json"]
)
def test_rule_accepts_innocent_source(innocent: str) -> None:
    assert not list(banned_uses(innocent))


def test_a_public_class_name_means_one_thing() -> None:
    places: dict[str, list[str]] = {}
    for path in python_files():
        for name in PUBLIC_CLASS.findall(path.read_text("utf-8")):
            places.setdefault(name, []).append(str(path.relative_to(ROOT)))
    assert len(places) > 500, "the classes were not found"
    assert not {name: found for name, found in places.items() if len(found) > 1}


def test_tracked_text_holds_no_machine_paths() -> None:
    here = Path(__file__).resolve()  # this file seeds such paths itself
    found = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in tracked_text_files()
        if path != here
        for line in machine_paths(path.read_text("utf-8", errors="replace"))
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "seeded", ["/home/ann/capture", "path = '/tmp/x'", r"C:\Users\bob", "(/root/.cache)", "/work/a"]
)
def test_machine_path_rule_refuses_seeded_text(seeded: str) -> None:
    assert machine_paths(seeded)


@pytest.mark.parametrize(
    "innocent", ["a/tmp/b", "https://host/home/x", "~/home/x", "/usr/lib", "either/or", "$OUT/tmp/x"]
)
def test_machine_path_rule_accepts_innocent_text(innocent: str) -> None:
    assert not machine_paths(innocent)


def odd_english(text: str, odd: re.Pattern[str] = ODD_ENGLISH) -> list[str]:
    """Lines of `text` with a turn of phrase that we do not use, as "line: text"."""
    return [f"{n}: {line.strip()}" for n, line in enumerate(text.splitlines(), 1) if odd.search(line)]


def test_text_is_idiomatic_english() -> None:
    here = Path(__file__).resolve()  # this file seeds such phrases itself
    found = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in tracked_text_files()
        if path != here and path.suffix in (".py", ".md", ".sh")
        for line in odd_english(path.read_text("utf-8", errors="replace"))
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "seeded",
    [
        "This folder is no capture.",
        "'wide' is no size",
        "Numbers that are no names",
        "where nobody says",
        "it is told at once",
    ],
)
def test_english_rule_refuses_seeded_text(seeded: str) -> None:
    assert odd_english(seeded)


def test_source_uses_the_words_of_the_glossary() -> None:
    files = python_files()
    found = [f"{path.relative_to(ROOT)}:{line}" for path in files for line in odd_english(path.read_text(), ODD_WORDS)]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "seeded",
    [
        "Stop the training: what was learned is kept.",
        "A camera path makes no sense.",
        "values that make no sense",
        "so that paths can be told apart",
        "There is no file manager that could show it.",
        "It opens no file of its own accord.",
        "The project is open for reading only",
        "This is a fault of the program.",
        "The clip goes on where it stopped",
        "anchors go on learning",
    ],
)
def test_the_rule_of_words_finds_each(seeded: str) -> None:
    assert odd_english(seeded, ODD_WORDS)


@pytest.mark.parametrize("innocent", ["There is no such folder.", "It is no longer there.", "is not a capture folder"])
def test_english_rule_accepts_plain_text(innocent: str) -> None:
    assert not odd_english(innocent)


def crowded(files: Iterable[str]) -> dict[str, int]:
    """Folders with too many of these files, and how many."""
    counts = Counter(Path(name).parent.as_posix() for name in files)
    return {folder: n for folder, n in counts.items() if n > MAX_FILES}


def test_folders_are_small_enough_to_be_looked_through() -> None:
    found = crowded(path.relative_to(ROOT).as_posix() for path in python_files())
    assert sorted(found) == sorted(LARGE_FOLDERS), "split a folder by idea, under names that say the ideas"


def test_crowded_folder_is_seen() -> None:
    names = [f"app/a/{i}.py" for i in range(MAX_FILES)]
    assert crowded([*names, "app/a/b/1.py"]) == {}
    assert crowded([*names, "app/a/one_more.py"]) == {"app/a": MAX_FILES + 1}
