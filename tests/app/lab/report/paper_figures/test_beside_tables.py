"""The paper's tables on a report's page: for which captures and folders, and which values."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from app.lab.paper_tables import ANOTHER_CAPTURE
from app.lab.report.comparison import Compared
from app.lab.report.page.tables import Table
from app.lab.report.paper_figures.beside_tables import paper_ablations_section, paper_tables_section
from tests.app.lab.report.made_up import Page, report, train


def compared(name: str, **settings: Any) -> Compared:
    known = {"holdout": ("0",), "fingerprint": "f", "scale": 0.5} | settings
    clips = [SimpleNamespace(n_frames=10)] * 3
    facts: Any = SimpleNamespace(
        name=name, settings=SimpleNamespace(**known), clips=clips, wall_s=7200.0, n_bytes=5_000_000
    )
    means = {"psnr": 29.0, "ssim": 0.93, "dssim1": 0.03, "dssim_range2": 0.02, "dssim_ms": 0.01, "lpips": None}
    return Compared(facts, {"means": {"held_out": means, "trained_on": {}}})


def capture(layout: str = "n3dv", folder: str = "cook_spinach") -> dict[str, Any]:
    cameras = [{"width": 2704, "height": 2028}] * 19
    return {"format": layout, "path": f"data/{folder}", "n_cameras": 19, "cameras": cameras}


def test_projects_of_a_capture_like_the_papers_stand_above_its_rows():
    others = [compared("q"), compared("r", scale=1.0)]
    section = paper_tables_section([compared("p"), *others], capture(folder="flame_salmon_1"))
    assert section is not None
    three, four = section.tables()
    assert [row["method"] for row in three.rows[:3]] == ["This project: p", "This project: q", "StreamRF"]
    own, printed = three.rows[0], three.rows[-1]
    assert (own["psnr"], own["hours"], own["megabytes"], own["fps"]) == (29.0, 2.0, 5.0, None)
    assert (own["dssim2"], own["dssim_range2"], own["dssim_ms"]) == (None, 0.02, 0.01)
    assert own["note"] == "measured here, 30 frames"
    assert (printed["psnr"], printed["dssim2"], printed["note"]) == (32.53, 0.012, "printed")
    notes = {row["method"]: row["note"] for row in three.rows}
    assert notes["SpaceTimeGS"] == "printed; time: more than that"
    assert four.rows[0]["ssim"] == 0.93
    assert paper_tables_section([compared("p")], capture(layout="panoptic")) is None


def test_folders_of_an_ablation_stand_next_to_their_rows():
    section = paper_ablations_section([compared("full-seed0"), compared("a/decoder-new-seed0"), compared("other")])
    assert section is not None
    said, table = section.parts
    assert said == ANOTHER_CAPTURE
    assert isinstance(table, Table)
    assert [(row["variant"], row["psnr"], row["paper_psnr"]) for row in table.rows] == [
        ("full", 29.0, 24.54),
        ("decoder-new", 29.0, 24.34),
    ]
    assert paper_ablations_section([compared("full-seed0"), compared("other")]) is None


def test_the_page_has_them(project, tmp_path, capture_folder):
    folders = [train(tmp_path / f"{name}-seed0", capture_folder) for name in ("full", "independent")]
    page = Page(report(folders[0], compare=folders[1:]).read_text(encoding="utf-8"))
    assert [row[:3] for row in page.tables["paper_ablations"]] == [
        ["full", "ClipGStream", "5, 6"],
        ["independent", "Independent Training", "6"],
    ]
    assert "another capture" in page.text
    assert "paper_ablations" not in Page(report(project).read_text(encoding="utf-8")).tables
