"""Command line of the generator: `python -m app.lab.synthetic --out assets/sample`."""

from __future__ import annotations

import argparse
import logging
from pathlib import Path

from app.lab.synthetic.scene import SAMPLE_CAMERAS
from app.lab.synthetic.writing import write_capture


def main() -> None:
    """Write the sample capture, or a smaller one."""
    parser = argparse.ArgumentParser(prog="python -m app.lab.synthetic", description="Write the sample capture.")
    parser.add_argument("--out", type=Path, required=True, help="folder for cameras.json and the videos")
    parser.add_argument("--truth", type=Path, help="folder for ground-truth depth and part indices")
    parser.add_argument("--width", type=int, default=320)
    parser.add_argument("--height", type=int, default=240)
    parser.add_argument("--cameras", type=int, default=SAMPLE_CAMERAS)
    parser.add_argument("--frames", type=int, default=30)
    parser.add_argument("--clip-length", type=int, default=10)
    parser.add_argument("--supersampling", type=int, default=3, help="rays along each side of a pixel")
    arguments = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    write_capture(
        arguments.out,
        size=(arguments.width, arguments.height),
        n_cameras=arguments.cameras,
        n_frames=arguments.frames,
        clip_length=arguments.clip_length,
        supersampling=arguments.supersampling,
        truth_dir=arguments.truth,
    )


if __name__ == "__main__":
    main()
