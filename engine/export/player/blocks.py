"""Blocks: what the page loads at once. One holds what stands still in all clips, and each clip has one of its own."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from engine.conventions import ALPHA_MIN
from engine.export.player.row_coding import color_max, encoded_rows, fitting_rounding, folded, rounded_colors
from engine.export.player.still_part import PlayerStillPart, shared_rows, still_part
from engine.export.splats import Splats


@dataclass(frozen=True, slots=True)
class Block:
    """Deflated bytes, and what the page has to know to read them.

    Attributes:
        data: A raw deflate stream.
        description: Plain values for the page's header; see docs/player_format.md.
    """

    data: bytes
    description: dict[str, Any]


class Packer:
    """Makes the blocks of one page, clip by clip. The still part of the first one is shared by all clips."""

    def __init__(self) -> None:
        self._shared: Splats | None = None
        self._shared_colors = np.zeros((0, 3), np.uint8)
        self.shared: Block | None = None

    def clip(self, n_frames: int, still: Callable[[int], Splats], moving: Callable[[int], Splats]) -> Block:
        """A clip's block; at the first call also the block of what clips share.

        Args:
            n_frames: Of the clip, as far as they are wanted.
            still, moving: The still and the moving splats, by the number of the frame in the clip.
        """
        part = still_part(n_frames, lambda frame: seen(still(frame)))
        if part is None:  # then all of it is stored for every frame
            frames = [joined(seen(still(frame)), seen(moving(frame))) for frame in range(n_frames)]
            part = PlayerStillPart(frames[0][:0], {0: frames[0].colors[:0]})
        else:
            frames = [seen(moving(frame)) for frame in range(n_frames)]
        if self._shared is None:
            self._share(part)
        pieces: list[bytes] = []
        description = {**self._still(part, pieces), "moving": _moving(frames, pieces)}
        return deflated(pieces, description)

    def _share(self, part: PlayerStillPart) -> None:
        self._shared = part.splats
        rounding = fitting_rounding([part.splats])
        self._shared_colors = rounded_colors(part.splats.colors, rounding.color_max)
        description = {"n": len(part.splats), "rounding": rounding.described()}
        self.shared = deflated([encoded_rows(part.splats, rounding)], description)

    def _still(self, part: PlayerStillPart, pieces: list[bytes]) -> dict[str, Any]:
        """Which shared rows are hidden, further rows, and the light on all that remain."""
        assert self._shared is not None
        found, is_hidden = shared_rows(self._shared, part.splats)
        if is_hidden.any():
            pieces.append(np.packbits(is_hidden, bitorder="little").tobytes())
        is_own = found < 0
        order = np.concatenate([np.flatnonzero(~is_own), np.flatnonzero(is_own)])  # as the page puts them together
        own = part.splats[np.flatnonzero(is_own)]
        rounding = fitting_rounding([own])
        if len(own):
            pieces.append(encoded_rows(own, rounding))
        before = np.concatenate([self._shared_colors[found[~is_own]], rounded_colors(own.colors, rounding.color_max)])
        return {
            "hides": bool(is_hidden.any()),
            "own": {"n": len(own), "rounding": rounding.described()} if len(own) else None,
            "light": _light({frame: colors[order] for frame, colors in part.colors.items()}, before, pieces),
        }


def _light(colors: dict[int, np.ndarray], before: np.ndarray, pieces: list[bytes]) -> dict[str, Any] | None:
    """Colours of what stands still at some frames; None where they are those of the rows throughout.

    Args:
        colors: By number of the frame in the clip.
        before: As the rows have them. [N, 3] uint8
        pieces: Where to put them.
    """
    brightest = color_max(list(colors.values()))
    levels = {frame: rounded_colors(values, brightest) for frame, values in colors.items()}
    if len(levels) == 1 and all(np.array_equal(values, before) for values in levels.values()):
        return None
    for values in levels.values():
        pieces.append(np.ascontiguousarray(folded(values - before).T).tobytes())
        before = values
    return {"frames": list(levels), "color_max": brightest}


def _moving(frames: Sequence[Splats], pieces: list[bytes]) -> dict[str, Any]:
    rounding = fitting_rounding(frames)
    pieces.extend(encoded_rows(frame, rounding) for frame in frames)
    return {"n": [len(frame) for frame in frames], "rounding": rounding.described()}


def seen(splats: Splats) -> Splats:
    """Rows that are not too faint to be drawn anywhere."""
    return splats[np.flatnonzero(splats.opacities > ALPHA_MIN)]


def joined(*parts: Splats) -> Splats:
    """Rows after rows."""
    names = ("means", "quats", "scales", "opacities", "colors")
    columns: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return replace(parts[0], **columns)


def deflated(pieces: Sequence[bytes], description: dict[str, Any]) -> Block:
    """A block of these bytes."""
    packer = zlib.compressobj(zlib.Z_BEST_COMPRESSION, zlib.DEFLATED, -zlib.MAX_WBITS, 9, zlib.Z_FILTERED)
    data = b"".join([*(packer.compress(piece) for piece in pieces), packer.flush()])
    return Block(data, {**description, "n_bytes": sum(map(len, pieces))})
