"""The child process of engine.cloud.stereo.sparse.

Never imported by the program: pycolmap must stay out of its processes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from engine.children.child import Parent
from engine.features.child_side import answer, extract_features, steady_verification
from engine.progress import Progress

MAX_ERROR_PX = 2.0


def triangulate_folder(arrays: dict[str, np.ndarray], folder: Path) -> dict[str, np.ndarray]:
    """Extract, match and triangulate in an empty folder.

    Returns:
        points [P, 3], colors [P, 3] 0..1, errors [P] px of reprojection, n_features.
    """
    import pycolmap

    database, names = extract_features(folder, arrays["images"], is_valid=arrays.get("is_valid"))
    model = folder / "model"
    model.mkdir()
    with pycolmap.Database.open(database) as tables:
        reconstruction = _known_reconstruction(pycolmap, tables, names, arrays["Ks"], arrays["world_to_camera"])
        n_features = int(tables.num_keypoints())
    pycolmap.match_exhaustive(database, verification_options=steady_verification(), device=pycolmap.Device.cpu)
    options = pycolmap.IncrementalPipelineOptions()
    options.random_seed = 0
    pictures = folder / "images"
    reconstruction = pycolmap.triangulate_points(reconstruction, database, pictures, model, options=options)
    found = [point for point in reconstruction.points3D.values() if point.error < MAX_ERROR_PX]
    return {
        "points": np.array([point.xyz for point in found]).reshape(-1, 3),
        "colors": np.array([point.color for point in found]).reshape(-1, 3) / 255.0,
        "errors": np.array([point.error for point in found]),
        "n_features": np.array(n_features),
    }


def _known_reconstruction(pycolmap, tables, names: list[str], Ks: np.ndarray, poses: np.ndarray):
    """A reconstruction without points whose cameras are the rig's; ids are looked up by name, never by order."""
    reconstruction = pycolmap.Reconstruction()
    for row, name in enumerate(names):
        image = tables.read_image_with_name(name)
        camera = tables.read_camera(image.camera_id)
        camera.params = [Ks[row, 0, 0], Ks[row, 1, 1], Ks[row, 0, 2], Ks[row, 1, 2]]
        camera.has_prior_focal_length = True
        tables.update_camera(camera)
        reconstruction.add_camera(camera)
    for rig in tables.read_all_rigs():
        reconstruction.add_rig(rig)
    for frame in tables.read_all_frames():
        (data,) = frame.data_ids
        name = next(i.name for i in tables.read_all_images() if i.image_id == data.id)
        pose = poses[names.index(name)]
        frame.rig_from_world = pycolmap.Rigid3d(pycolmap.Rotation3d(pose[:3, :3]), pose[:3, 3])
        reconstruction.add_frame(frame)
    for name in names:
        reconstruction.add_image(tables.read_image_with_name(name))
    for frame_id in list(reconstruction.frames):
        reconstruction.register_frame(frame_id)
    return reconstruction


def main(shared: Path, parent: Parent[Progress]) -> None:
    """Runs in the child."""
    answer(shared, triangulate_folder)
