"""clipgstream render: what is wrong with its arguments."""


def test_rendering_names_what_is_wrong_with_its_arguments(run, capture_folder, tmp_path):
    run("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3, "--clips", "0")
    render = ("render", tmp_path / "p", "--out", tmp_path / "o.mp4")
    for extra, expected in (
        (("--camera", "9"), "no camera '9'"),
        (("--camera", "0,1"), "one camera"),
        (("--camera", "1", "--frames", "4:99"), "frames 0 to 5"),
        (("--camera", "1", "--frames", "0:6"), "Frame 3 lies in clip 1, which is not trained"),
        (("--camera", "1", "--frames", "0:2", "--out", tmp_path / "o.gif"), "not a video format"),
    ):
        code, _, err = run(*render, *extra)
        assert (code, expected in err) == (2, True), err
    assert not list(tmp_path.glob("o.*"))
