"""The synthetic sample capture: a textured room that Open3D ray-casts, so that its truth is not made of Gaussians.

`python -m app.lab.synthetic --out assets/sample` regenerates the shipped sample. Tests call `write_capture` with
small sizes. Ground truth: `make_truth` (depth, object and motion masks) and `SceneCamera` (pictures, coverage).
"""

from app.lab.synthetic.raycast import SceneCamera, Truth, make_truth
from app.lab.synthetic.scene import SyntheticScene, make_scene
from app.lab.synthetic.writing import write_capture

__all__ = ["SceneCamera", "SyntheticScene", "Truth", "make_scene", "make_truth", "write_capture"]
