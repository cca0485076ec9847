"""The Blender add-on of assets/blender as the zip that Blender installs."""

from __future__ import annotations

from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from engine.assets import asset_path
from engine.errors import ProjectError
from engine.storage.files import atomic_path, disk_error

FILE = "clipgstream_blender.zip"


def write_addon(folder: Path) -> Path:
    """Write the add-on into a folder, which is made; an earlier one is replaced. The same files make the same zip.

    Raises:
        ProjectError: This installation lacks its files. DiskError: It could not be written.
    """
    path, sources = folder / FILE, sorted(asset_path("blender").glob("*"))
    if not sources:
        where = asset_path("blender")
        raise ProjectError("The add-on is not in this installation.", hint="Install the program again.", path=where)
    try:
        with atomic_path(path) as partial, ZipFile(partial, "w") as target:
            for source in sources:
                if source.suffix in (".py", ".toml"):
                    target.writestr(ZipInfo(source.name), source.read_bytes(), ZIP_DEFLATED)
    except OSError as error:
        raise disk_error(error, what="The add-on", path=path) from error
    return path
