"""The file formats that Gaussians are written in: suffix, what each keeps, and how near a file has to come."""

from __future__ import annotations

from collections.abc import Callable
from typing import BinaryIO, NamedTuple

from engine.export.formats import compressed_ply, glb, ply, sog, splat, spz
from engine.export.splats import Splats


class Format(NamedTuple):
    """One file format.

    Attributes:
        suffix: With its point.
        summary: What it is for and what it keeps, for lists of choices.
        min_psnr_db: A file that was read back looks this much like the scene, or something went wrong.
        bytes_each: Of a Gaussian in a file, about; for a forecast.
        write: Writes splats into a file and returns sentences about what it could not store as it is.
        read: Reads them back.
    """

    suffix: str
    summary: str
    min_psnr_db: float
    bytes_each: float
    write: Callable[[Splats, BinaryIO], tuple[str, ...]]
    read: Callable[[BinaryIO], Splats]


FORMATS: dict[str, Format] = {
    "ply": Format(".ply", "everything as it is, in 14 floats; read by nearly all", 50.0, 56.0, ply.write, ply.read),
    "compressed-ply": Format(
        ".compressed.ply",
        "positions to 1/2000 of a small block, colours to 8 bits; PlayCanvas, SuperSplat",
        38.0,
        16.3,
        compressed_ply.write,
        compressed_ply.read,
    ),
    "spz": Format(
        ".spz",
        "positions to 1/4096 unit, the rest to 6 to 10 bits; small, widely read",
        38.0,
        15.0,
        spz.write,
        spz.read,
    ),
    "splat": Format(
        ".splat",
        "positions and scales as they are, the rest to 8 bits; older viewers",
        33.0,
        32.0,
        splat.write,
        splat.read,
    ),
    "glb": Format(".glb", "everything as it is, as glTF with KHR_gaussian_splatting", 50.0, 60.0, glb.write, glb.read),
    "sog": Format(
        ".sog", "pictures in a zip file; the smallest, for PlayCanvas and SuperSplat", 38.0, 12.5, sog.write, sog.read
    ),
}
"""By the name that the command line has for it."""
