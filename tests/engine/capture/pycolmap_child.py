"""Child process of the tests: lets pycolmap write a model, and say where its points fall. Arguments: FOLDER."""

from __future__ import annotations

import json
import sys
import zlib  # noqa: F401  must be loaded before pycolmap
from pathlib import Path

import numpy as np


def write_model(folder: Path) -> None:
    """A model of one camera per model of COLMAP, written as text and binary; expected.json says where points fall."""
    import pycolmap

    models = {name: kind for name, kind in pycolmap.CameraModelId.__members__.items() if 0 <= int(kind) <= 15}
    generator = np.random.default_rng(4)
    reconstruction = pycolmap.Reconstruction()
    points = generator.uniform(-0.5, 0.5, (10, 3))
    expected = {}
    for number, (name, kind) in enumerate(sorted(models.items()), start=1):
        camera = pycolmap.Camera.create_from_model_id(number, kind, 300.0 + number, 400, 300)
        params = np.array(camera.params)
        names = [part.strip() for part in camera.params_info.split(",")]
        for row, parameter in enumerate(names):
            if parameter in ("cx", "cy"):
                params[row] += 3.7
            elif parameter == "fy":
                params[row] *= 1.02
            elif parameter == "omega":
                params[row] = 0.8
            elif parameter not in ("f", "fx"):
                params[row] = generator.uniform(-0.02, 0.02)
        camera.params = params.tolist()
        reconstruction.add_camera_with_trivial_rig(camera)
        axis = generator.uniform(-0.4, 0.4, 3)
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(axis), np.array([0.1, -0.2, 3.0 + 0.1 * number]))
        image = pycolmap.Image(name=f"{name}.png", image_id=number, camera_id=number)
        image.points2D = pycolmap.Point2DList([pycolmap.Point2D(np.array([1.0, 2.0]))] * (10 + number))
        reconstruction.add_image_with_trivial_frame(image, pose)
        image = reconstruction.image(number)
        expected[name] = [np.asarray(image.project_point(point)).tolist() for point in points]
    for row, point in enumerate(points):
        track = pycolmap.Track()
        track.add_element(1, row)
        reconstruction.add_point3D(point, track, np.array([row, 2 * row, 255], np.uint8))
    for kind in ("binary", "text"):
        (folder / kind).mkdir(parents=True)
    reconstruction.write_binary(folder / "binary")
    reconstruction.write_text(folder / "text")
    reconstruction.export_PLY(folder / "points.ply")
    (folder / "expected.json").write_text(json.dumps({"points": points.tolist(), "pixels": expected}))


def read_model(folder: Path) -> None:
    """Read what our writer wrote, and write read.json: names, sizes, and where the points of points.json fall."""
    import pycolmap

    points = np.array(json.loads((folder / "points.json").read_text()))
    found = {}
    for kind in ("binary", "text"):
        reconstruction = pycolmap.Reconstruction(folder / kind)
        found[kind] = {
            "pixels": {
                image.name: [np.asarray(image.project_point(point)).tolist() for point in points]
                for image in reconstruction.images.values()
            },
            "n_points": len(reconstruction.points3D),
            "sizes": [[camera.width, camera.height] for camera in reconstruction.cameras.values()],
        }
    (folder / "read.json").write_text(json.dumps(found))


if __name__ == "__main__":
    (write_model if sys.argv[1] == "write" else read_model)(Path(sys.argv[2]))
