"""Clouds of all frames of a clip as files: they take minutes, and of all learned values depend on the gains alone.

prep/cloud-000010-1f0c9a3e.safetensors    of the clip that begins with frame 10, and of the inputs in the key

A file of another key has another name, so that variants of one training, and trainings anew, find theirs.
"""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from engine.cloud.stereo.frames_cloud import FramesCloud
from engine.errors import DiskError
from engine.storage.array_files import ArraysError, read_arrays, write_arrays

logger = logging.getLogger(__name__)

CLOUD_FILES = "cloud-*.safetensors"
"""Pattern of all such files of a folder."""
_VERSION = 1
"""Grows when the same pictures give another cloud."""
_ARRAYS = {"points": np.float32, "colors": np.float32, "gains": np.float32, "n_of_frames": np.int64}


def kept_cloud(prep_dir: Path, start: int, key: dict[str, Any], build: Callable[[], FramesCloud]) -> FramesCloud:
    """The cloud of a clip from its file, or built and kept.

    Args:
        prep_dir: Folder of files that clips share.
        start: First frame of the clip.
        key: JSON-able: everything that the cloud depends on.
        build: Makes it.
    """
    words = json.dumps(key | {"version": _VERSION}, sort_keys=True)
    name = CLOUD_FILES.replace("*", f"{start:06d}-{hashlib.sha256(words.encode()).hexdigest()[:8]}")
    cloud = _read(prep_dir / name, words)
    if cloud is not None:
        return cloud
    cloud = build()
    arrays = {kind: np.asarray(getattr(cloud, kind)) for kind in _ARRAYS} | {"spacing": np.array([cloud.spacing])}
    try:
        write_arrays(prep_dir / name, arrays, {"key": words}, what="The cloud")
    except DiskError as error:  # it would only be found again
        logger.warning("a cloud was not stored: %s", error)
    return cloud


def _read(path: Path, words: str) -> FramesCloud | None:
    try:
        arrays, metadata = read_arrays(path, ("key",))
        if metadata["key"] != words:
            return None
        n_points = len(arrays["points"])
        is_whole = all(arrays[kind].dtype == dtype for kind, dtype in _ARRAYS.items())
        if not is_whole or arrays["points"].shape != (n_points, 3) or arrays["colors"].shape != (n_points, 3):
            raise ArraysError("its arrays are inconsistent")
        return FramesCloud(**{kind: arrays[kind] for kind in _ARRAYS}, spacing=float(arrays["spacing"][0]))
    except FileNotFoundError:
        return None
    except (OSError, ArraysError, KeyError, IndexError) as error:
        logger.warning("a stored cloud cannot be read (%s) and is rebuilt - %s", error, path)
        return None
