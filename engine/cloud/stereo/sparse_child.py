"""The child process of engine.cloud.stereo.sparse: `python -m engine.cloud.stereo.sparse_child JOB.npz RESULT.npz
BEAT`.

Never imported by the program: pycolmap must stay out of its processes.
"""

from __future__ import annotations

import shutil
import zlib  # noqa: F401  must be loaded before pycolmap, whose own zlib symbols otherwise replace it
from pathlib import Path

import numpy as np
from PIL import Image

from engine.children.child import serve

MAX_FEATURES = 2048
MAX_SIDE_PX = 1280
"""Larger pictures are matched smaller: SIFT on full HD takes minutes, and depth ranges need no more."""
MAX_ERROR_PX = 2.0


def main(job: Path, result: Path) -> None:
    """Read the job's arrays, triangulate, write points, colors, errors and n_features."""
    with np.load(job) as arrays:
        images, Ks, poses = arrays["images"], arrays["Ks"], arrays["world_to_camera"]
    folder = job.with_name("colmap")
    shutil.rmtree(folder, ignore_errors=True)  # of an attempt before
    folder.mkdir()
    points, colors, errors, n_features = triangulate_folder(folder, images, Ks, poses)
    partial = result.with_name("partial.npz")
    np.savez(partial, points=points, colors=colors, errors=errors, n_features=n_features)
    partial.replace(result)


def triangulate_folder(
    folder: Path, images: np.ndarray, Ks: np.ndarray, poses: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Extract, match and triangulate in an empty folder.

    Returns:
        points [P, 3], colors [P, 3] 0..1, reprojection errors [P] px, number of features.
    """
    import pycolmap

    pycolmap.set_random_seed(0)
    names = [f"{i:04d}.png" for i in range(len(images))]
    pictures, database, model = folder / "images", folder / "database.db", folder / "model"
    pictures.mkdir()
    model.mkdir()
    for name, image in zip(names, images, strict=True):
        Image.fromarray(image).save(pictures / name, compress_level=1)
    reader = pycolmap.ImageReaderOptions(camera_model="PINHOLE")
    # images first: extraction alone would number them in the order in which its threads finish
    pycolmap.Database.open(database).close()
    pycolmap.import_images(database, pictures, pycolmap.CameraMode.PER_IMAGE, image_names=names, options=reader)
    extraction = pycolmap.FeatureExtractionOptions()
    extraction.sift.max_num_features = MAX_FEATURES
    extraction.max_image_size = MAX_SIDE_PX
    pycolmap.extract_features(
        database,
        pictures,
        image_names=names,
        camera_mode=pycolmap.CameraMode.PER_IMAGE,
        reader_options=reader,
        extraction_options=extraction,
        device=pycolmap.Device.cpu,
    )
    with pycolmap.Database.open(database) as tables:
        reconstruction = _known_reconstruction(pycolmap, tables, names, Ks, poses)
        n_features = int(tables.num_keypoints())
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = 0  # else the outcome depends on which thread takes which pair
    pycolmap.match_exhaustive(database, verification_options=verification, device=pycolmap.Device.cpu)
    options = pycolmap.IncrementalPipelineOptions()
    options.random_seed = 0
    reconstruction = pycolmap.triangulate_points(reconstruction, database, pictures, model, options=options)
    found = [point for point in reconstruction.points3D.values() if point.error < MAX_ERROR_PX]
    points = np.array([point.xyz for point in found]).reshape(-1, 3)
    colors = np.array([point.color for point in found]).reshape(-1, 3) / 255.0
    return points, colors, np.array([point.error for point in found]), n_features


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


if __name__ == "__main__":
    serve(main)
