"""The Blender add-on of assets/blender as the zip that Blender installs."""

from __future__ import annotations

from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from engine.assets import asset_path
from engine.storage.files import atomic_path, disk_error

FILE = "clipgstream_blender.zip"


def write_addon(folder: Path) -> Path:
    """Write the add-on into a folder, which is made; an earlier one is replaced. The same files make the same zip.

    Raises:
        DiskError: It could not be written.
    """
    path = folder / FILE
    try:
        with atomic_path(path) as partial, ZipFile(partial, "w") as target:
            for source in sorted(asset_path("blender").iterdir()):
                if source.suffix in (".py", ".toml"):
                    target.writestr(ZipInfo(source.name), source.read_bytes(), ZIP_DEFLATED)
    except OSError as error:
        raise disk_error(error, what="The add-on", path=path) from error
    return path
