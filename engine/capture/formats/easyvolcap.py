"""EasyVolcap, EasyMocap, ENeRF and newer ZJU-MoCap captures: intri.yml, extri.yml and images/<camera>/.

Both files are OpenCV YAML. `names` lists the cameras; each has `K_`, optionally `H_`, `W_`, `D_` (older: `dist_`) and
`ccm_` in the first file and `R_` (a rotation vector) or `Rot_` and `T_`, world to camera, in the second. Pixel centres
are at whole numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from engine.camera.lens import Lens
from engine.capture.cameras.described_camera import DescribedCamera
from engine.capture.cameras.opencv_numbers import lens_of, pose_of, shifted
from engine.capture.cameras.opencv_yaml import Value, number, read_opencv_yaml
from engine.capture.files.frame_files import natural_key
from engine.capture.files.frame_search import FrameSearch
from engine.capture.layout.assembling import assemble
from engine.capture.layout.findings import Findings
from engine.capture.layout.format_checks import is_name, parse_size, shortened, size_problem
from engine.capture.layout.format_result import MATCH, Layout, Probe
from engine.errors import CaptureError
from engine.text import shown

FORMAT = "easyvolcap"
LAYOUT = "intri.yml, extri.yml and images/<camera>/ (EasyVolcap, EasyMocap, ENeRF, ZJU-MoCap)"
"""The layout in words."""
INTRI, EXTRI = "intri.yml", "extri.yml"
FRAME_FOLDERS = ("images", "videos", "")
MASK_FOLDERS = ("masks", "mask")


def probe(folder: Path) -> Probe:
    """Whether the folder looks like this layout."""
    found = [name for name in (INTRI, EXTRI) if (folder / name).is_file()]
    if len(found) == 2:
        return MATCH
    if not found:
        return Probe(False, lacks=f"no {INTRI} and {EXTRI}")
    other, holds = (EXTRI, "poses") if found == [INTRI] else (INTRI, "intrinsics")
    return Probe(False, seen=found[0], lacks=f"no {other}", hint=f"Put {other} next to it; it holds the {holds}.")


def read(folder: Path, *, follow_links: bool = False) -> Layout:
    """Read cameras and the headers of their frames; no pixels.

    Args:
        follow_links: Whether frames may lie outside of the folder.
    Raises:
        CaptureError: Listing every problem found.
    """
    findings = Findings()
    intri = findings.tried(lambda: _Table(folder / INTRI, read_opencv_yaml(folder / INTRI)))
    extri = findings.tried(lambda: _Table(folder / EXTRI, read_opencv_yaml(folder / EXTRI)))
    names = None if intri is None else findings.tried(intri.names)
    cameras: list[DescribedCamera] = []
    warnings: list[str] = []
    if intri is not None and extri is not None and names is not None:
        search = FrameSearch(folder, FRAME_FOLDERS, follow_links=follow_links, named_in=intri.path)
        mask_search = FrameSearch(folder, MASK_FOLDERS, follow_links=follow_links, named_in=intri.path)
        placed = [name for name in names if any(f"{key}_{name}" in extri.entries for key in ("R", "Rot", "T"))]
        if placed and len(placed) < len(names):  # intrinsics of a whole stage, of which some cameras were used
            others = shortened([shown(name) for name in names if name not in placed])
            warnings.append(f"Cameras of which {EXTRI} has no pose are left out: {others}.")
        for name in sorted(placed or names, key=natural_key):
            camera = _described(name, intri, extri, search, findings)
            if camera is not None:
                masks, fault = mask_search.masks([name], camera.files)
                cameras.append(replace(camera, masks=masks))
                warnings += [f'Masks of camera "{name}" are not used: {fault}.'] if fault else []
    return assemble(folder, FORMAT, cameras, problems=findings.problems, warnings=warnings, said_in=folder / INTRI)


@dataclass(frozen=True, eq=False)
class _Table:
    """One of the two files."""

    path: Path
    entries: dict[str, Value]

    def names(self) -> list[str]:
        """The cameras."""
        names = self.entries.get("names")
        if not isinstance(names, list) or not names:
            hint = "List the cameras under names, as EasyMocap does."
            raise CaptureError("The file lists no names.", hint=hint, path=self.path)
        return names

    def matrix(self, key: str, shape: tuple[int, int] | None = None) -> np.ndarray | None:
        """A matrix [rows, cols] of this shape; None where it is not there.

        Raises:
            CaptureError: It is not a matrix, or has another shape.
        """
        value = self.entries.get(key)
        if value is None:
            return None
        if not isinstance(value, np.ndarray) or (shape is not None and value.shape != shape):
            wanted = "a matrix" if shape is None else f"a {shape[0]}x{shape[1]} matrix"
            found = "x".join(map(str, value.shape)) if isinstance(value, np.ndarray) else shown(value)
            text = f"{shown(key)} is {found}, not {wanted}."
            raise CaptureError(text, hint="Export the calibration again.", path=self.path)
        return value

    def needed(self, key: str, shape: tuple[int, int] | None = None) -> np.ndarray:
        """Likewise; also raises where it is not there."""
        value = self.matrix(key, shape)
        if value is None:
            hint = "Export the calibration again, or take the camera out of names."
            raise CaptureError(f"The file has no {shown(key)}.", hint=hint, path=self.path)
        return value


def _described(
    name: str, intri: _Table, extri: _Table, search: FrameSearch, findings: Findings
) -> DescribedCamera | None:
    """One camera; None where something is wrong with it, which is kept."""
    called = name if is_name(name) else shown(name)
    K = findings.tried(lambda: intri.needed(f"K_{name}", (3, 3)), camera=called)
    sizes = findings.tried(lambda: [_size(name, intri)], camera=called)
    lens = findings.tried(lambda: _lens(name, intri), camera=called)
    pose = findings.tried(lambda: _pose(name, extri), camera=called)
    colors = findings.tried(lambda: [intri.matrix(f"ccm_{name}", (3, 3))], camera=called)
    files = findings.tried(lambda: search.files([name]), camera=called)
    if K is None or sizes is None or lens is None or pose is None or colors is None or files is None:
        return None
    is_unchanged = colors[0] is None or np.array_equal(colors[0], np.eye(3))
    return DescribedCamera(
        name=name,
        K=shifted(K),
        world_to_camera=pose,
        files=files,
        said_in=intri.path,
        calibrated_size=sizes[0],
        lens=lens,
        color_matrix=None if is_unchanged else colors[0],
    )


def _size(name: str, intri: _Table) -> tuple[int, int] | None:
    """Width and height that K belongs to; None where the file does not say."""
    entries = [intri.entries.get(f"{key}_{name}") for key in ("W", "H")]
    sides = [number(entry) for entry in entries]
    if all(entry is None or (side is not None and side <= 0) for entry, side in zip(entries, sides, strict=True)):
        return None  # 0 and -1 are written for what is not known
    whole = [int(side) if side is not None and side == round(side) else None for side in _finite(sides)]
    size = parse_size(whole[0], whole[1])
    if size is None:
        raise size_problem(f"W_{name} and H_{name} are", entries[0], entries[1], intri.path)
    return size


def _finite(sides: list[float | None]) -> list[float | None]:
    return [side if side is not None and math.isfinite(side) else None for side in sides]


def _lens(name: str, intri: _Table) -> Lens:
    values = intri.matrix(f"D_{name}")
    values = intri.matrix(f"dist_{name}") if values is None else values
    return lens_of(np.zeros(0) if values is None else values, is_fisheye=False, path=intri.path)


def _pose(name: str, extri: _Table) -> np.ndarray:
    """R_ is a rotation vector, in some files a matrix; Rot_ the matrix."""
    rotation = extri.matrix(f"R_{name}")
    rotation = extri.needed(f"Rot_{name}") if rotation is None else rotation
    translation = extri.needed(f"T_{name}")
    if rotation.size not in (3, 9) or translation.size != 3:
        which = f"{rotation.size} numbers in its rotation and {translation.size} in its translation"
        raise CaptureError(f"It has {which}.", hint="Give 3 or 3x3, and 3.", path=extri.path)
    return pose_of(rotation, translation)
