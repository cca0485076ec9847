"""Writes the shared scene as Metashape exports cameras, and a video per camera.

Written from what the file means, not from the reader: the pose goes through a component and a chunk that turn, scale
and move, lenses have their p1 and p2 the other way round than OpenCV, centres are counted from the middle.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.engine.capture.layouts.scene import Scene

LENSES = ("pinhole", "opencv4", "opencv5")
"""What the layout can say."""
PLACES = (
    (np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([1.0, -2.0, 0.5]), 2.5),
    (np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]), np.array([-3.0, 0.25, 4.0]), 0.4),
)
"""Rotation, translation and scale of the chunk and of the component in it."""


def _words(values: np.ndarray) -> str:
    return " ".join(f"{value:.17g}" for value in np.ravel(values))


def _transform(turn: np.ndarray, moved: np.ndarray, scale: float) -> str:
    return (
        f"<transform><rotation>{_words(turn)}</rotation><translation>{_words(moved)}</translation>"
        f"<scale>{scale:.17g}</scale></transform>"
    )


def write(folder: Path, scene: Scene, *, is_plain: bool = False) -> None:
    """Write the scene into this folder. is_plain: without component, transform of the chunk, and zeros."""
    folder.mkdir(parents=True, exist_ok=True)
    width, height = scene.size
    sensors, cameras = [], []
    places = () if is_plain else PLACES
    for row, name in enumerate(scene.names):
        scene.write_video(folder / "videos" / f"{name}.mp4", row)
        K = scene.Ks[row]
        k1, k2, p1, p2, k3 = [*scene.lenses[row].params, 0.0, 0.0, 0.0, 0.0, 0.0][:5]
        values = {"f": K[1, 1], "cx": K[0, 2] - width / 2, "cy": K[1, 2] - height / 2, "b1": K[0, 0] - K[1, 1]}
        values |= {"k1": k1, "k2": k2, "k3": k3, "p1": p2, "p2": p1}
        texts = "".join(f"<{key}>{value:.17g}</{key}>" for key, value in values.items() if value or not is_plain)
        resolution = f'<resolution width="{width}" height="{height}"/>'
        sensors.append(
            f'<sensor id="{row}" label="unknown" type="frame">{resolution}<property name="layer_index" value="0"/>'
            f'<calibration type="frame" class="initial">{resolution}<f>1000</f></calibration>'
            f'<calibration type="frame" class="adjusted">{resolution}{texts}</calibration></sensor>'
        )
        to_world = np.linalg.inv(scene.world_to_camera[row])
        for turn, moved, scale in places:
            to_world[:3, :3] = turn.T @ to_world[:3, :3]
            to_world[:3, 3] = turn.T @ (to_world[:3, 3] - moved) / scale
        component = "" if is_plain else ' component_id="7"'
        cameras.append(
            f'<camera id="{row}" sensor_id="{row}"{component} label="{name}.jpg">\n'
            f"<transform>{_words(to_world)}</transform></camera>"
        )
    chunk, component = ("", "") if is_plain else (_transform(*PLACES[0]), _transform(*PLACES[1]))
    (folder / "cameras.xml").write_text(
        f"""<?xml version="1.0" encoding="UTF-8"?>
<document version="2.0.0"><chunk label="Chunk 1" enabled="true">
<sensors next_id="9">{"".join(sensors)}</sensors>
<components next_id="9"><component id="7" label="Component 1">{component}</component></components>
<cameras next_id="9">{"".join(cameras)}<camera id="8" sensor_id="0" label="not_aligned"/></cameras>
{chunk}<reference>LOCAL_CS["Local Coordinates (m)"]</reference></chunk></document>
""",
        encoding="utf-8",
    )
