"""Pictures as videos and as PNG files."""

import numpy as np
import pytest

from app.cli.video import write_pictures, write_video
from engine.errors import ProjectError


def test_a_video_holds_every_picture_and_odd_sizes_fit(tmp_path):
    import av

    images = [np.full((35, 47, 3), 20 * i, np.uint8) for i in range(5)]
    assert write_video(tmp_path / "v.mp4", iter(images), fps=25.0) == 5
    with av.open(str(tmp_path / "v.mp4")) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
        assert float(container.streams.video[0].average_rate or 0) == 25.0
    assert [frame.shape for frame in frames] == [(36, 48, 3)] * 5
    # H.264 in limited range with chroma at half size: grey comes back within a few levels
    assert max(abs(int(frame.mean()) - 20 * i) for i, frame in enumerate(frames)) <= 3


def test_a_video_that_fails_half_way_leaves_nothing(tmp_path):
    def images():
        yield np.zeros((16, 16, 3), np.uint8)
        raise ProjectError("The clip is damaged.")

    with pytest.raises(ProjectError, match="damaged"):
        write_video(tmp_path / "v.mp4", images(), fps=25.0)
    assert list(tmp_path.iterdir()) == []


def test_pictures_are_numbered_by_frame(tmp_path):
    assert write_pictures(tmp_path / "out", ((i, np.zeros((4, 4, 3), np.uint8)) for i in (7, 12))) == 2
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["frame_000007.png", "frame_000012.png"]
