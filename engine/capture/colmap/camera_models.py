"""COLMAP's camera models: their numbers and names, and what they are as K and a lens."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.camera.lens import PARAMETER_NAMES, Lens, LensModel
from engine.errors import CaptureError


@dataclass(frozen=True, slots=True)
class CameraModel:
    """One of COLMAP's models.

    Attributes:
        name: As text files have it.
        n_focals: 1 where both directions share a focal length, else 2.
        lens: Of `engine.camera.lens`.
        n_lens: How many of its parameters follow the principal point, in the lens's own order.
    """

    name: str
    n_focals: int
    lens: LensModel
    n_lens: int = 0

    @property
    def n_params(self) -> int:
        """Numbers that a camera of this model has in a file."""
        return self.n_focals + 2 + self.n_lens


MODELS: dict[int, CameraModel] = {
    0: CameraModel("SIMPLE_PINHOLE", 1, "pinhole"),
    1: CameraModel("PINHOLE", 2, "pinhole"),
    2: CameraModel("SIMPLE_RADIAL", 1, "opencv", 1),
    3: CameraModel("RADIAL", 1, "opencv", 2),
    4: CameraModel("OPENCV", 2, "opencv", 4),
    5: CameraModel("OPENCV_FISHEYE", 2, "fisheye", 4),
    6: CameraModel("FULL_OPENCV", 2, "opencv", 8),
    7: CameraModel("FOV", 2, "fov", 1),
    8: CameraModel("SIMPLE_RADIAL_FISHEYE", 1, "fisheye", 1),
    9: CameraModel("RADIAL_FISHEYE", 1, "fisheye", 2),
    10: CameraModel("THIN_PRISM_FISHEYE", 2, "thin_prism_fisheye", 8),
    14: CameraModel("SIMPLE_FISHEYE", 1, "fisheye"),
    15: CameraModel("FISHEYE", 2, "fisheye"),
}
"""Models that are read, by the number that binary files have."""
UNREAD = {
    11: "RAD_TAN_THIN_PRISM_FISHEYE",
    12: "SIMPLE_DIVISION",
    13: "DIVISION",
    16: "EUCM",
    17: "EQUIRECTANGULAR",
}
"""Models that COLMAP knows and this program does not."""
UNREAD_PARAMS = {11: 16, 12: 4, 13: 5, 16: 6, 17: 2}
"""How many numbers those have in a file."""
BY_NAME = {model.name: number for number, model in MODELS.items()} | {name: number for number, name in UNREAD.items()}
HINT = (
    "Undistort the images with `colmap image_undistorter`, or calibrate with the model OPENCV, FULL_OPENCV or "
    "OPENCV_FISHEYE."
)


def calibration_of(model_id: int, params: np.ndarray) -> tuple[np.ndarray, Lens]:
    """K [3, 3], pixel centres at +0.5 as COLMAP has them, and lens.

    Args:
        model_id: As in binary files.
        params: As many as the model has.
    Raises:
        CaptureError: The model is not read; the message has no path.
    """
    model = MODELS.get(model_id)
    if model is None:
        name = UNREAD.get(model_id, f"number {model_id}")
        raise CaptureError(f"Its camera model {name} is not supported.", hint=HINT)
    fx, fy = params[0], params[model.n_focals - 1]
    cx, cy = params[model.n_focals : model.n_focals + 2]
    values = [float(value) for value in params[model.n_focals + 2 :]]
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return K, Lens(model.lens, tuple(values))


def model_of(K: np.ndarray, lens: Lens) -> tuple[int, np.ndarray]:
    """The smallest of COLMAP's models that says this, and its parameters: the other way round of `calibration_of`.

    Raises:
        CaptureError: No model of COLMAP has such a lens.
    """
    values = np.zeros(len(PARAMETER_NAMES[lens.model]))
    values[: len(lens.params)] = lens.params
    own = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2]])
    if lens.is_pinhole:
        return 1, own
    for number in (4, 5, 6, 7, 10):
        model = MODELS[number]
        if model.lens == lens.model and not values[model.n_lens :].any():
            return number, np.concatenate([own, values[: model.n_lens]])
    raise CaptureError(
        "COLMAP has no camera model for a lens with the prism terms s1 to s4.", hint="Convert to capture.json instead."
    )
