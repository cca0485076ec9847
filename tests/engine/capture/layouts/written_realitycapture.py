"""Writes the shared scene as RealityCapture exports metadata: an XMP file per camera, and videos of the same names."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.engine.capture.layouts.scene import Scene

LENSES = ("pinhole", "opencv4", "opencv5")
"""What the layout can say."""


def write(folder: Path, scene: Scene) -> None:
    """Write the scene into this folder."""
    width, height = scene.size
    longer = max(width, height)
    for row, name in enumerate(scene.names):
        scene.write_video(folder / f"{name}.mp4", row)
        K, pose = scene.Ks[row], scene.world_to_camera[row]
        position = -pose[:3, :3].T @ pose[:3, 3]
        k1, k2, p1, p2, k3 = [*scene.lenses[row].params, 0.0, 0.0, 0.0, 0.0, 0.0][:5]
        model = "brown3t2" if scene.lenses[row].params else "perspective"
        words = {
            "Rotation": pose[:3, :3],
            "Position": position,
            "DistortionCoeficients": np.array([k1, k2, k3, 0.0, p1, p2]),
        }
        texts = "".join(
            f"<xcr:{key}>{' '.join(f'{value:.17g}' for value in np.ravel(values))}</xcr:{key}>"
            for key, values in words.items()
        )
        (folder / f"{name}.xmp").write_text(
            f"""<x:xmpmeta xmlns:x="adobe:ns:meta/">
  <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
    <rdf:Description xcr:Version="3" xcr:PosePrior="exact" xcr:Coordinates="absolute" xcr:DistortionModel="{model}"
       xcr:FocalLength35mm="{K[0, 0] / longer * 36:.17g}" xcr:Skew="0" xcr:AspectRatio="{K[1, 1] / K[0, 0]:.17g}"
       xcr:PrincipalPointU="{(K[0, 2] - width / 2) / longer:.17g}"
       xcr:PrincipalPointV="{(K[1, 2] - height / 2) / longer:.17g}" xcr:CalibrationPrior="exact"
       xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#">{texts}</rdf:Description>
  </rdf:RDF>
</x:xmpmeta>
""",
            encoding="utf-8",
        )
