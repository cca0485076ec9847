"""Reads a player page of ClipGStream Studio with numpy alone. The layout is in docs/player_format.md.

    python read_player.py scene.html 12

writes the Gaussians of the page's frame 12 to scene_12.npz: means, quats (wxyz), scales, opacities and colors.
"""

from __future__ import annotations

import base64
import json
import re
import sys
import zlib
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

OTHERS = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])


class Part:
    """Bytes of a level of a block, taken from its beginning to its end."""

    def __init__(self, data: bytes, n_bytes: int) -> None:
        unpacker = zlib.decompressobj(wbits=-15)
        self.data = unpacker.decompress(data, n_bytes + 1)  # never more than the header claims
        self.at = 0
        assert len(self.data) == n_bytes, f"a part has {len(self.data)} bytes instead of {n_bytes}"

    def take(self, n_planes: int, n: int) -> np.ndarray:
        """[n, n_planes] uint8"""
        self.at += n_planes * n
        return np.frombuffer(self.data[self.at - n_planes * n : self.at], np.uint8).reshape(n_planes, n).T

    def changes(self, n: int) -> np.ndarray:
        """How far whole numbers differ from others: x, y, z, largest, three, scales, opacity, RGB. [n, 14] uint16"""
        words = self.take(3, n).astype(np.uint16)
        words |= self.take(3, n).astype(np.uint16) << 8
        return np.concatenate([unfolded(words), unfolded(self.take(11, n)).astype(np.uint16)], axis=1)

    def numbers(self, n: int) -> np.ndarray:
        """Whole numbers of rows. [n, 14] uint16"""
        return wrapped(np.cumsum(self.changes(n), axis=0, dtype=np.uint16))

    def frames(self, n_rows: int, counts: list[int]) -> list[np.ndarray]:
        """Whole numbers of the rows of each frame: a row is stored where it appears, and then how it changes."""
        bits = [np.unpackbits(self.take(1, (n_rows + 7) // 8)[:, 0], bitorder="little")[:n_rows] for _ in counts]
        now, changes = self.numbers(n_rows), self.changes(sum(counts) - n_rows)
        frames, n_known, n_changes = [], 0, 0
        for found in bits:
            rows = np.flatnonzero(found)
            old = rows[rows < n_known]
            now[old] = wrapped(now[old] + changes[n_changes : n_changes + len(old)])
            n_changes += len(old)
            n_known = max([n_known, *(rows + 1)])
            frames.append(now[rows])
        return frames


def wrapped(numbers: np.ndarray) -> np.ndarray:
    """Positions modulo 65536, the others modulo 256."""
    numbers[:, 3:] &= 255
    return numbers


def gaussians(numbers: np.ndarray, rounding: dict[str, Any]) -> dict[str, np.ndarray]:
    """What whole numbers stand for; colours also as they are."""
    largest, levels = numbers[:, 3].astype(int), rounding["quat_levels"]
    three = (numbers[:, 4:7] - float(levels)) / (levels * np.sqrt(2.0))
    quats = np.zeros((len(numbers), 4))
    np.put_along_axis(quats, OTHERS[largest], three, 1)
    quats[np.arange(len(numbers)), largest] = np.sqrt(np.maximum(1.0 - np.square(three).sum(1), 0.0))
    return {
        "means": rounding["origin"] + rounding["step"] * numbers[:, :3].astype(float),
        "quats": quats,
        "scales": np.exp(rounding["scale_low"] + rounding["scale_step"] * numbers[:, 7:10].astype(float)),
        "opacities": numbers[:, 10] / rounding["opacity_levels"],
        "colors": numbers[:, 11:] * (rounding["color_max"] / rounding["color_levels"]),
        "levels": numbers[:, 11:].astype(np.uint8),
    }


def unfolded(values: np.ndarray) -> np.ndarray:
    """0, 1, 2, 3, 4 as 0, -1, 1, -2, 2, modulo 256 or 65536."""
    return (values >> 1) ^ (-(values & 1).astype(values.dtype)).astype(values.dtype)


class Page:
    """A page and its frames."""

    def __init__(self, path: Path) -> None:
        self.path, self.html = path, path.read_text(encoding="utf-8")
        self.header = json.loads(self._element("header"))
        assert (self.header["format"], self.header["version"]) == ("clipgstream-player", 2)
        shared = self.header["shared"]
        numbers = [part.numbers(n) for part, n in zip(self._parts("shared", shared), shared["levels"], strict=True)]
        self.shared = [gaussians(one, shared["rounding"]) for one in numbers]
        self.n_frames = sum(len(clip["moving"]["n"]) for clip in self.header["clips"])

    def _element(self, name: str) -> str:
        found = re.search(rf'<script type="[^"]*" id="{name}">([^<]*)</script>', self.html)
        assert found is not None, f"the page has no {name}"
        return found[1]

    def _parts(self, name: str, about: dict[str, Any]) -> list[Part]:
        if self.header["folder"] is None:
            data = base64.b64decode(self._element(f"block-{name}"))
        else:
            data = (self.path.with_name(unquote(self.header["folder"])) / f"{name}.bin").read_bytes()
        ends = np.cumsum([0, *(n_packed for n_packed, _ in about["parts"])])
        return [Part(data[ends[i] : ends[i + 1]], n_bytes) for i, (_, n_bytes) in enumerate(about["parts"])]

    def frame(self, frame: int, n_levels: int | None = None) -> dict[str, np.ndarray]:
        """All Gaussians of a frame, or those of the first levels; in each level what stands still comes first."""
        clip = next(clip for clip in reversed(self.header["clips"]) if clip["first"] <= frame)
        parts = self._parts(clip["name"], clip)[:n_levels]
        return joined(*(self._level(clip, level, part, frame - clip["first"]) for level, part in enumerate(parts)))

    def _level(self, clip: dict[str, Any], level: int, part: Part, in_clip: int) -> dict[str, np.ndarray]:
        still, own, moving = self.shared[level], clip["own"], clip["moving"]
        if clip["hides"]:
            n_shared = len(still["means"])
            bits = np.unpackbits(part.take(1, (n_shared + 7) // 8)[:, 0], bitorder="little")
            still = {name: values[bits[:n_shared] == 0] for name, values in still.items()}
        if own is not None:
            still = joined(still, gaussians(part.numbers(own["levels"][level]), own["rounding"]))
        if clip["light"] is not None:
            still = {**still, "colors": lit(part, clip["light"], still["levels"], in_clip)}
        frames = part.frames(moving["rows"][level], moving["levels"][level])
        return joined(still, gaussians(frames[in_clip], moving["rounding"]))


def lit(part: Part, light: dict[str, Any], levels: np.ndarray, frame: int) -> np.ndarray:
    """Colours of what stands still in a frame: between the stored ones they are linear in time. [n, 3]"""
    keys = []
    for _ in light["frames"]:
        levels = levels + unfolded(part.take(3, len(levels)))
        keys.append(levels * (light["color_max"] / 255.0))
    flat = np.stack(keys).reshape(len(keys), -1)
    mixed = [np.interp(frame, light["frames"], column) for column in flat.T]
    return np.array(mixed).reshape(-1, 3)


def joined(*parts: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Rows after rows."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


if __name__ == "__main__":
    page, number = Page(Path(sys.argv[1])), int(sys.argv[2])
    arrays = page.frame(number)
    arrays.pop("levels")
    np.savez(page.path.with_name(f"{page.path.stem}_{number}.npz"), allow_pickle=False, **arrays)
