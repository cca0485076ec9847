"""The child process of engine.features.matching.

Never imported by the program: pycolmap must stay out of its processes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from engine.children.child import Parent
from engine.features.child_side import answer, extract_features, steady_verification
from engine.progress import Progress

LEAST_CONTRAST = 0.002
"""A third of COLMAP's: plain walls have faint features only, and wrong matches are sorted out later."""


def match_folder(arrays: dict[str, np.ndarray], folder: Path) -> dict[str, np.ndarray]:
    """Key points of all pictures, and which of them each pair shares, verified without any calibration."""
    import pycolmap

    max_features, max_bytes = int(arrays["max_features"]), int(arrays["max_bytes"])
    # taken out: pictures are not needed again once they lie in the folder
    database, names = extract_features(folder, arrays.pop("images"), max_features, LEAST_CONTRAST, max_bytes=max_bytes)
    listed = folder / "pairs.txt"
    listed.write_text("".join(f"{names[a]} {names[b]}\n" for a, b in arrays["pairs"]))
    pairing = pycolmap.ImportedPairingOptions()
    pairing.match_list_path = listed
    pycolmap.match_image_pairs(
        database,
        pairing_options=pairing,
        verification_options=steady_verification(),
        device=pycolmap.Device.cpu,
    )
    pixels, rows, counts = [], [], []
    with pycolmap.Database.open(database) as tables:
        id_of = {image.name: image.image_id for image in tables.read_all_images()}
        ids = [id_of[name] for name in names]
        key_points = [np.asarray(tables.read_keypoints(image_id))[:, :2] for image_id in ids]
        for a, b in arrays["pairs"]:
            found = tables.read_two_view_geometry(ids[a], ids[b]).inlier_matches
            matches = np.asarray(found, dtype=np.int64).reshape(-1, 2)
            matches = matches[np.lexsort(matches.T)]
            pixels.append(np.concatenate([key_points[a][matches[:, 0]], key_points[b][matches[:, 1]]], axis=1))
            counts.append(len(matches))
            rows.append(matches)
    return {
        "pixels": np.concatenate([np.zeros((0, 4)), *pixels]),
        "rows": np.concatenate([np.zeros((0, 2), dtype=np.int64), *rows]),
        "counts": np.array(counts, dtype=np.int64),
        "n_features": np.array([len(found) for found in key_points], dtype=np.int64),
    }


def main(shared: Path, parent: Parent[Progress]) -> None:
    """Runs in the child."""
    answer(shared, match_folder)
