"""A new edit touches five source files: an example is written into a copy of the source and found in every layer."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
MAX_FILES = 5
FADE = '''class Fade(EditAction, frozen=True, tag="fade"):
    """They are drawn less opaque."""

    label = "Fade"
    meaning = "It is less opaque"
    adverb = "to {share:.0%} ({of})"

    share: Annotated[float, value("How much is left", "Left", "--fade SHARE", low=0, high=1)]
    of: Annotated[str, value("What fades", "Of", "--of PART", choices={"light": "", "all": "opacity, too"})] = "all"


Action = Hide'''
CASE = "                case Transform():"
EXAMPLE = {
    "engine/editing/actions.py": {
        "Action = Hide": FADE,
        "| Hold | Smooth": "| Hold | Smooth | Fade",
        '"Expose", ': '"Expose", "Fade", ',
    },
    "engine/editing/changed_gaussians.py": {
        "import Expose,": "import Expose, Fade,",
        "action: Recolor) -> Tensor": "action: Recolor | Fade) -> Tensor",
        "(opacities * action.opacity)": "(opacities * (action.share if isinstance(action, Fade) else action.opacity))",
    },
    "engine/editing/edited_clip.py": {
        "import Delete, Expose,": "import Delete, Expose, Fade,",
        CASE: "                case Fade():\n"
        "                    left = faded(now.gaussians.opacities, chosen(now), effect.action)\n"
        "                    now = replace(now, gaussians=replace(now.gaussians, opacities=left))\n" + CASE,
    },
    "engine/editing/still_part.py": {
        "import Delete, Expose,": "import Delete, Expose, Fade,",
        CASE: "                case Fade():\n"
        "                    left = faded(shapes.opacities, is_chosen, effect.action)\n"
        "                    shapes = replace(shapes, opacities=left)\n" + CASE,
    },
    "ui/panels/editing/panel/making.py": {
        "import Action, Delete, Expose,": "import Action, Delete, Expose, Fade,",
        "    DELETE,\n": "    DELETE,\n    _making(Fade, lambda *where: Fade(0.5)),\n",
    },
}
FIND = """
import json, sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from unittest.mock import MagicMock

import clipgstream
from app.cli.cli import main
from app.command_text.step_command import edit_command
from app.document.changes.edit_words import edit_title
from engine.editing.edit import Everything
from engine.editing.effects import Effect, Effects
from tests.app.made_projects import make_project
from tests.documents.edits import edits_table
from tests.engine.editing.edited_clips import edited, make_clip
from ui.panels.actions.table import ACTIONS
from ui.panels.editing.panel import details

found = {"file": clipgstream.__file__}
made = make_project(Path(sys.argv[1]))
made.close()
with redirect_stdout(StringIO()):
    code = main(["edit", str(made.folder), "--fade", "0.25", "--of", "light"])
with clipgstream.open_project(made.folder) as project:
    (edit,) = project.edits
    named = project.apply_edit("fade", share=0.25, of="light")
    found["scripts"] = named.action == edit.action == clipgstream.Fade(0.25, "light")
found["command line"] = code == 0
found["words"] = edit_title(edit)
found["command text"] = edit_command(made.folder, edit).arguments[2:]
found["python text"] = edit_command(made.folder, edit).statement
found["actions"] = [action.text for action in ACTIONS if action.id == "edit.fade"]
found["documents"] = [line for line in edits_table().splitlines() if line.startswith("| Fade")]

fields = []
details.imgui, details.label_before = MagicMock(), fields.append
details.imgui.combo.return_value = (True, 1)
details.numbers = lambda ui, name, label, parts, *, low, high, **said: fields.append([label, low, high]) or (0.75,)
found["changed"] = repr(details._draw_action(MagicMock(), MagicMock(), edit.action))
found["fields"] = fields

clip, effects = edited(make_clip()), (Effect(Everything(), clipgstream.Fade(0.25)),)
before, after = clip.decode(0.5), clip.decode(0.5, Effects(effects, "fade"))
found["effect"] = bool(((after.gaussians.opacities - 0.25 * before.gaussians.opacities).abs() < 1e-6).all())
found["still"] = after.n_still
print(json.dumps(found))
"""


def test_an_example_edit_is_found_in_every_layer(tmp_path: Path) -> None:
    source = tmp_path / "source"
    for package in ("app", "assets", "engine", "ui"):
        shutil.copytree(ROOT / package, source / package, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("clipgstream.py", "pyproject.toml"):
        shutil.copy(ROOT / name, source)
    (source / "tests").symlink_to(ROOT / "tests")
    for name, changes in EXAMPLE.items():
        text = (source / name).read_text("utf-8")
        for old, new in changes.items():
            assert text.count(old) == 1, f"{name}: {old}"
            text = text.replace(old, new)
        (source / name).write_text(text, "utf-8")
    assert len(EXAMPLE) <= MAX_FILES

    command = [sys.executable, "-c", FIND, str(tmp_path / "project")]
    done = subprocess.run(command, cwd=source, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.splitlines()[-1]) == {
        "file": str(source / "clipgstream.py"),
        "scripts": True,
        "command line": True,
        "words": "fade everything to 25% (light)",
        "command text": ["--fade", "0.25", "--of", "light"],
        "python text": "project.apply_edit(Fade(share=0.25, of='light'))",
        "actions": ["Fade the selection"],
        "documents": [
            '| Fade | It is less opaque | `--fade SHARE`, `--of PART` | `"fade"`: `share` 0 to 1, `of` light, all |'
        ],
        "changed": "Fade(share=0.75, of='all')",
        "fields": [["Left", 0, 1], "Of"],
        "effect": True,
        "still": 27,
    }
