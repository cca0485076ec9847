"""SIFT features of pictures, for tests: a child process, because pycolmap replaces signal handlers.

python sift_child.py PICTURES.npz FEATURES.npz      name [H, W] float32 -> name-xy [N, 2], name-descriptors [N, 128]
"""

from __future__ import annotations

import sys
import warnings

import numpy as np


def main(source: str, target: str) -> None:
    """Features of every picture in the file."""
    warnings.simplefilter("ignore")
    import pycolmap

    sift = pycolmap.Sift()
    found = {}
    with np.load(source) as pictures:
        for name in pictures:
            points, descriptors = sift.extract(pictures[name])
            unit = descriptors / np.maximum(np.linalg.norm(descriptors, axis=1, keepdims=True), 1e-9)
            found[f"{name}-xy"], found[f"{name}-descriptors"] = points[:, :2], unit.astype(np.float32)
    np.savez(target, **found)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
