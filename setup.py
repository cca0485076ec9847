"""How the wheel differs from the repository: everything lies in one package, `clipgstream`.

In the repository `app`, `engine`, `ui` and `assets` lie side by side, and an editable install leaves them there. Such
names belong to no single program, so a wheel holds `clipgstream/app`, `clipgstream/engine` and so on, clipgstream.py as
`clipgstream/__init__.py`, and imports between them that say so. Strings that name modules stay as they are; see
engine/own_modules.py. All other settings are in pyproject.toml.
"""

import ast
import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.egg_info import egg_info

NAME = "clipgstream"
PACKAGES = ("app", "engine", "ui")
FOLDERS = (*PACKAGES, "assets")


def below_one_name(source: bytes, where: str) -> bytes:
    """A Python file with its imports of our packages found below `clipgstream`; all else byte by byte as it was.

    Args:
        source: In UTF-8.
        where: Name of the file, for the error.
    Raises:
        ValueError: `import app.x` without `as` would bind another name than it does in the repository.
    """
    lines = source.splitlines(keepends=True)
    found: list[tuple[int, int]] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and not node.level and _is_ours(node.module or ""):
            found.append((node.lineno - 1, node.col_offset + len("from ")))
        elif isinstance(node, ast.Import):
            for name in node.names:
                if _is_ours(name.name) and name.asname is None:
                    raise ValueError(f"{where}, line {name.lineno}: write `from ... import` for {name.name}")
                if _is_ours(name.name):
                    found.append((name.lineno - 1, name.col_offset))
    for line, column in sorted(found, reverse=True):
        before, after = lines[line][:column], lines[line][column:]
        if not after.startswith(tuple(name.encode() for name in PACKAGES)):
            raise ValueError(f"{where}, line {line + 1}: write the import with single blanks, on one line")
        lines[line] = before + f"{NAME}.".encode() + after
    return b"".join(lines)


def _is_ours(module: str) -> bool:
    return module.partition(".")[0] in PACKAGES


class BuildOnePackage(build_py):
    """Builds the packages as ever, then moves them below the one name."""

    def run(self) -> None:
        """Build."""
        if self.editable_mode:
            super().run()
            return
        built = Path(self.build_lib)
        shutil.rmtree(built, ignore_errors=True)  # files that an earlier build left would get into the wheel
        super().run()
        package = built / NAME
        package.mkdir()
        (built / f"{NAME}.py").rename(package / "__init__.py")
        for name in FOLDERS:
            (built / name).rename(package / name)
        for path in package.rglob("*.py"):
            path.write_bytes(below_one_name(path.read_bytes(), path.relative_to(built).as_posix()))


class OneNameInfo(egg_info):
    """Names the one package as what an install brings."""

    def run(self) -> None:
        """Write the folder of metadata."""
        super().run()
        Path(self.egg_info, "top_level.txt").write_text(f"{NAME}\n", encoding="ascii")


if __name__ == "__main__":
    setup(cmdclass={"build_py": BuildOnePackage, "egg_info": OneNameInfo})
