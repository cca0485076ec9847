"""Speed against error within a project: its trainings over time, and the formats of its exports."""

from __future__ import annotations

import json

from app.lab.bench.rows import Trade
from app.lab.report import costs
from app.project.project_facts import read_facts
from tests.app.lab.report.made_up import report


def test_the_section_has_trainings_and_exports(project, monkeypatch):
    curves = {}
    monkeypatch.setattr(costs, "draw_training", lambda found, *_: curves.update(found) or b"png")
    rows = [
        {"step": 0, "training_s": 0.5, "held_out_psnr": 12.0},
        {"step": 9, "loss": 0.5},
        {"step": 9, "training_s": 3.5, "held_out_psnr": 20.0},
        {"step": 9, "training_s": 3.5, "stages_s": {}},
    ]
    facts = read_facts(project, "p")
    facts.project.metrics_path(0).parent.mkdir(exist_ok=True)
    facts.project.metrics_path(0).write_text("".join(f"{json.dumps(row)}\n" for row in rows))
    trade = Trade("export", "spz", "spz", 0.25, 1_500_000, 57.0)
    report(project, exports_of=lambda opened: [trade])
    numbers = json.loads((project / "reports" / "report.json").read_text())
    assert curves == {"clip 0": [(0.5, 12.0), (3.5, 20.0)]}
    assert {"figures/training_curves.png", "figures/exports.png"} <= set(numbers["files"])
    expected = {"mark": 1, "format": "spz", "write_ms": 250.0, "psnr_db": 57.0, "megabytes": 1.5}
    assert numbers["tables"]["exports"]["rows"] == [expected]


def test_curves_without_times_and_no_measured_exports_are_left_out(project):
    report(project)
    files = json.loads((project / "reports" / "report.json").read_text())["files"]
    assert not {"figures/training_curves.png", "figures/exports.png"} & set(files)
