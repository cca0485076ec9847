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


class Block:
    """Bytes of a block, taken from its beginning to its end."""

    def __init__(self, text: str, n_bytes: int) -> None:
        self.data = zlib.decompress(base64.b64decode(text), wbits=-15)
        self.at = 0
        assert len(self.data) == n_bytes, f"a block has {len(self.data)} bytes instead of {n_bytes}"

    def take(self, n_planes: int, n: int) -> np.ndarray:
        """[n, n_planes] uint8"""
        self.at += n_planes * n
        return np.frombuffer(self.data[self.at - n_planes * n : self.at], np.uint8).reshape(n_planes, n).T

    def rows(self, n: int, rounding: dict[str, Any]) -> dict[str, np.ndarray]:
        """Gaussians; their colours also as bytes."""
        words = self.take(3, n).astype(np.uint16)
        words |= self.take(3, n).astype(np.uint16) << 8
        positions = np.cumsum(unfolded(words), axis=0, dtype=np.uint16)
        values = np.cumsum(unfolded(self.take(11, n)), axis=0, dtype=np.uint8)
        largest = values[:, 0].astype(int)
        three = (values[:, 1:4] - 127.0) / (127.0 * np.sqrt(2.0))
        quats = np.zeros((n, 4))
        np.put_along_axis(quats, OTHERS[largest], three, 1)
        quats[np.arange(n), largest] = np.sqrt(np.maximum(1.0 - np.square(three).sum(1), 0.0))
        return {
            "means": rounding["origin"] + rounding["step"] * positions.astype(float),
            "quats": quats,
            "scales": np.exp(rounding["scale_low"] + rounding["scale_step"] * values[:, 4:7].astype(float)),
            "opacities": values[:, 7] / 255.0,
            "colors": values[:, 8:11] * (rounding["color_max"] / 255.0),
            "levels": values[:, 8:11],
        }


def unfolded(values: np.ndarray) -> np.ndarray:
    """0, 1, 2, 3, 4 as 0, -1, 1, -2, 2, modulo 256 or 65536."""
    return (values >> 1) ^ (-(values & 1).astype(values.dtype)).astype(values.dtype)


class Page:
    """A page and its frames."""

    def __init__(self, path: Path) -> None:
        self.path, self.html = path, path.read_text(encoding="utf-8")
        self.header = json.loads(self._element("header"))
        assert (self.header["format"], self.header["version"]) == ("clipgstream-player", 1)
        shared = self.header["shared"]
        self.shared = self._block("shared", shared["n_bytes"]).rows(shared["n"], shared["rounding"])
        self.n_frames = sum(len(clip["moving"]["n"]) for clip in self.header["clips"])

    def _element(self, name: str) -> str:
        found = re.search(rf'<script type="[^"]*" id="{name}">([^<]*)</script>', self.html)
        assert found is not None, f"the page has no {name}"
        return found[1]

    def _block(self, name: str, n_bytes: int) -> Block:
        if self.header["folder"] is None:
            return Block(self._element(f"block-{name}"), n_bytes)
        script = self.path.with_name(unquote(self.header["folder"])) / f"{name}.js"
        return Block(json.loads(f"[{script.read_text().partition('(')[2].rpartition(')')[0]}]")[1], n_bytes)

    def frame(self, frame: int) -> dict[str, np.ndarray]:
        """All Gaussians of a frame, what stands still first."""
        clip = next(clip for clip in reversed(self.header["clips"]) if clip["first"] <= frame)
        in_clip, block = frame - clip["first"], self._block(clip["name"], clip["n_bytes"])
        n_shared = len(self.shared["means"])
        is_shown = np.ones(n_shared, bool)
        if clip["hides"]:
            bits = np.unpackbits(block.take(1, (n_shared + 7) // 8)[:, 0], bitorder="little")
            is_shown = bits[:n_shared] == 0
        still = {name: values[is_shown] for name, values in self.shared.items()}
        if clip["own"] is not None:
            still = joined(still, block.rows(clip["own"]["n"], clip["own"]["rounding"]))
        if clip["light"] is not None:
            still["colors"] = lit(block, clip["light"], still["levels"], in_clip)
        moving = [block.rows(n, clip["moving"]["rounding"]) for n in clip["moving"]["n"][: in_clip + 1]]
        return joined(still, moving[-1])


def lit(block: Block, light: dict[str, Any], levels: np.ndarray, frame: int) -> np.ndarray:
    """Colours of what stands still in a frame: between the stored ones they are linear in time. [n, 3]"""
    keys = []
    for _ in light["frames"]:
        levels = levels + unfolded(block.take(3, len(levels)))
        keys.append(levels * (light["color_max"] / 255.0))
    flat = np.stack(keys).reshape(len(keys), -1)
    mixed = [np.interp(frame, light["frames"], column) for column in flat.T]
    return np.array(mixed).reshape(-1, 3)


def joined(some: dict[str, np.ndarray], others: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Rows after rows."""
    return {name: np.concatenate([values, others[name]]) for name, values in some.items()}


if __name__ == "__main__":
    page, number = Page(Path(sys.argv[1])), int(sys.argv[2])
    arrays = page.frame(number)
    arrays.pop("levels")
    np.savez(page.path.with_name(f"{page.path.stem}_{number}.npz"), **arrays)
