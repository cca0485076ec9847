"""Writes the shared scene as Qualisys Track Manager exports it, and videos with serial numbers in their names.

Written from what the file means, not from the reader: 64ths of a pixel from the corner of the sensor, millimetres, the
axes of the camera (right, up, backwards) as rows.
"""

from __future__ import annotations

from pathlib import Path

from tests.engine.capture.layouts.scene import Scene

LENSES = ("pinhole", "opencv4", "opencv5")
"""What the layout can say."""
SERIALS = ("26578", "26579", "26580", "26585")


def write(folder: Path, scene: Scene, *, left: int = 0, top: int = 0, place: str = "calibration") -> None:
    """Write the scene into this folder. left, top: pixels of the sensor before those that were recorded."""
    (folder / place).mkdir(parents=True, exist_ok=True)
    width, height = scene.size
    rows = []
    for row, serial in enumerate(scene.names):
        scene.write_video(folder / "videos" / f"Walk 3_Miqus_{row + 1}_{serial}.mp4", row)
        K, pose = scene.Ks[row], scene.world_to_camera[row]
        position = -pose[:3, :3].T @ pose[:3, 3] * 1000
        right, down, forward = pose[:3, :3]
        axes = [*right, *-down, *-forward]
        k1, k2, p1, p2, k3 = [*scene.lenses[row].params, 0.0, 0.0, 0.0, 0.0, 0.0][:5]
        names = [f"r{r}{c}" for r in (1, 2, 3) for c in (1, 2, 3)]
        rotation = " ".join(f'{name}="{value:.15f}"' for name, value in zip(names, axes, strict=True))
        area = f'left="{left}" top="{top}" right="{left + width - 1}" bottom="{top + height - 1}"'
        whole = (left + width + 8, top + height + 4)
        rows.append(
            f'<camera active="1" calibrated="true" message="" point-count="2241" avg-residual="0.5" serial="{serial}" '
            f'model="Miqus Video" viewrotation="0" video_resolution="1080p">\n'
            f"  <fov_marker {area}/>\n  <fov_video {area}/>\n"
            f'  <transform x="{position[0]:.12f}" y="{position[1]:.12f}" z="{position[2]:.12f}" {rotation}/>\n'
            f'  <intrinsic focallength="9.27" sensorMinU="0" sensorMaxU="{64 * whole[0] - 1}" sensorMinV="0" '
            f'sensorMaxV="{64 * whole[1] - 1}" focalLengthU="{K[0, 0] * 64:.12f}" focalLengthV="{K[1, 1] * 64:.12f}" '
            f'centerPointU="{(K[0, 2] + left) * 64:.12f}" centerPointV="{(K[1, 2] + top) * 64:.12f}" skew="0.0" '
            f'radialDistortion1="{k1!r}" radialDistortion2="{k2!r}" radialDistortion3="{k3!r}" '
            f'tangentalDistortion1="{p1!r}" tangentalDistortion2="{p2!r}"/>\n'
            "</camera>"
        )
    text = "<?xml version='1.0' encoding='UTF-8'?>\n<calibration created=\"2026\" qtm-version=\"2024.3\">\n<cameras>\n"
    content = text + "\n".join(rows) + "\n</cameras>\n</calibration>\n"
    (folder / place / "Calib.qca.txt").write_text(content, encoding="utf-8")


def marker_camera(serial: str) -> str:
    """One more camera, which sees markers only and has no video."""
    return (
        f'<camera active="1" calibrated="true" serial="{serial}" model="Arqus A12">'
        '<fov_video left="0" top="0" right="4095" bottom="3071"/>'
        '<transform x="1" y="2" z="3" r11="1" r12="0" r13="0" r21="0" r22="1" r23="0" r31="0" r32="0" r33="1"/>'
        '<intrinsic focalLengthU="200000" focalLengthV="200000" centerPointU="131072" centerPointV="98304" skew="0" '
        'radialDistortion1="0" radialDistortion2="0" radialDistortion3="0" tangentalDistortion1="0" '
        'tangentalDistortion2="0"/></camera>'
    )
