"""The file formats that Gaussians are written in: their names and words, and how near a file has to come."""

from __future__ import annotations

from collections.abc import Callable
from typing import BinaryIO, NamedTuple

from engine.export.formats import compressed_ply, glb, ply, sog, splat, spz
from engine.export.splats import Splats


class Format(NamedTuple):
    """One file format.

    Attributes:
        title: Its name for users.
        use: Its purpose, in a few words.
        suffix: With its point.
        min_psnr_db: A file that was read back looks this much like the scene, or something went wrong.
        bytes_each: Of a Gaussian in a file, about; for a forecast.
        write: Writes splats into a file and returns sentences about what it could not store as it is.
        read: Reads them back.
    """

    title: str
    use: str
    suffix: str
    min_psnr_db: float
    bytes_each: float
    write: Callable[[Splats, BinaryIO], tuple[str, ...]]
    read: Callable[[BinaryIO], Splats]


FORMATS: dict[str, Format] = {
    "ply": Format(
        "PLY",
        "floats, for nearly all programs: SuperSplat, Blender, Unity, Unreal, Open3D and others",
        ".ply",
        50.0,
        56.0,
        ply.write,
        ply.read,
    ),
    "compressed-ply": Format(
        "Compressed PLY",
        "a third of that, for SuperSplat, PlayCanvas, Spark and Brush",
        ".compressed.ply",
        38.0,
        16.3,
        compressed_ply.write,
        compressed_ply.read,
    ),
    "spz": Format(
        "SPZ",
        "a quarter of that, for Niantic's programs, Blender, SuperSplat and Spark",
        ".spz",
        38.0,
        15.0,
        spz.write,
        spz.read,
    ),
    "splat": Format("splat", "for older viewers in browsers", ".splat", 33.0, 32.0, splat.write, splat.read),
    "glb": Format("glTF (.glb)", "glTF 2.0 with KHR_gaussian_splatting", ".glb", 50.0, 60.0, glb.write, glb.read),
    "sog": Format("SOG", "the smallest, for SuperSplat, PlayCanvas and Spark", ".sog", 38.0, 12.5, sog.write, sog.read),
}
"""By the name that the command line has for it, in the order in which they are offered."""
FULL_PLY = FORMATS["ply"]._replace(bytes_each=248.0, write=ply.write_full)
"""For programs that read rows of 248 bytes only."""


def read_file(suffix: str, file: BinaryIO) -> Splats:
    """Read a file of any of the formats; a .ply may be compressed, whatever it is called.

    Args:
        suffix: Of its name, in lower case, with its point: the last one where it has several.
        file: At its beginning.
    Raises:
        ProjectError: It is something else.
    """
    head = file.read(1 << 12)
    file.seek(0)
    if suffix == ".ply" and compressed_ply.is_compressed(head):
        return compressed_ply.read(file)
    return next(kind.read for kind in FORMATS.values() if kind.suffix == suffix)(file)
