"""Published figures beside a project's own: when they are shown, which ones, and how ours are marked."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from app.lab.published import CAVEATS, HOLDOUT, N_FRAMES, PUBLISHED, SEQUENCES, SIZE, published_of, sequence_of
from app.lab.report.beside_published import published_section
from app.lab.report.comparison import Compared
from app.lab.report.page.tables import Table


def compared(name: str = "p", *, psnr: float = 29.28, n_frames: tuple[int, ...] = (10, 10), **settings: Any) -> Any:
    known = {"holdout": ("30", "0", "10", "15"), "fingerprint": "f", "scale": 1.0} | settings
    clips = [SimpleNamespace(n_frames=n) for n in n_frames]
    facts: Any = SimpleNamespace(name=name, settings=SimpleNamespace(**known), clips=clips)
    means = {"psnr": psnr, "psnr_fit": 99.0, "ssim": 0.931, "lpips": None}
    return Compared(facts, {"means": {"held_out": means, "trained_on": {}}})


def capture(path: str = "data/basketball", *, layout: str = "panoptic", size: tuple[int, int] = SIZE) -> dict[str, Any]:
    camera = {"working_width": size[0], "working_height": size[1]}
    return {"format": layout, "path": path, "cameras": [camera] * 31}


def rows_of(projects: list[Any], described: dict[str, Any]) -> list[dict[str, Any]]:
    section = published_section(projects, described)
    assert section is not None
    assert CAVEATS in section.parts
    (table,) = section.tables()
    assert isinstance(table, Table)
    return table.rows


def test_ours_stands_above_the_figures_of_the_sequence_with_its_number_of_frames():
    own, *printed = rows_of([compared()], capture())
    assert (own["method"], own["psnr"], own["n_frames"]) == ("This project: p", 29.28, 20)
    assert own["caveat"] == "20 frames, not 150: no claim to the published figure"
    assert [(row["method"], row["psnr"]) for row in printed] == [
        ("Dynamic 3D Gaussians", 28.22),
        ("3GS-O", 27.02),
        ("Dynamic 3D Gaussians", 28.54),
        ("S4D (GoS2)", 27.72),
    ]
    said = {row["source"].split(",")[0]: row["n_frames"] for row in printed}
    assert said == {"Luiten et al.": N_FRAMES, "S4D": None}
    assert all(row["source"] for row in printed)


def test_all_frames_need_no_reservation_and_projects_of_the_same_kind_stand_there_too():
    others = [compared("q", n_frames=(N_FRAMES,)), compared("r", scale=0.5), compared("s", holdout=("1",))]
    rows = rows_of([compared(), *others], capture())
    assert [row["method"] for row in rows[:3]] == [
        "This project: p",
        "This project: q",
        "Dynamic 3D Gaussians",
    ]
    assert rows[1]["caveat"] == ""


def test_where_the_folder_does_not_name_the_sequence_all_are_listed():
    section = published_section([compared()], capture("captures/far40"))
    assert section is not None
    assert any(isinstance(part, str) and "all of them are listed" in part for part in section.parts)
    rows = rows_of([compared()], capture("captures/far40"))
    assert len(rows) == 1 + len(PUBLISHED)
    assert rows[0]["sequence"] is None


@pytest.mark.parametrize(
    ("project", "described"),
    [
        (compared(holdout=("0", "10", "15")), capture()),
        (compared(holdout=(*HOLDOUT, "5")), capture()),
        (compared(), capture(layout="sample")),
        (compared(), capture(size=(320, 180))),
    ],
)
def test_other_data_and_other_protocols_have_no_such_section(project, described):
    assert published_section([project], described) is None


def test_the_nearest_folder_names_the_sequence():
    assert sequence_of(Path("data/Basketball")) == "basketball"
    assert sequence_of(Path("data/tennis/basketball/ims")) == "basketball"
    assert sequence_of(Path("data/basketball2")) is None


def test_every_sequence_has_the_two_methods_of_the_paper():
    for sequence in SEQUENCES:
        methods = [one.method for one in published_of(sequence)]
        assert methods[:2] == ["Dynamic 3D Gaussians", "3GS-O"]
    means = {
        method: sum(one.psnr for one in PUBLISHED if one.method == method and "table 1" in one.source) / 6
        for method in ("Dynamic 3D Gaussians", "3GS-O")
    }
    assert means["Dynamic 3D Gaussians"] == pytest.approx(28.7, abs=0.05)  # the means that are printed beside them
    assert means["3GS-O"] == pytest.approx(28.21, abs=0.01)
