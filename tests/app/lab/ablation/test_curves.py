"""Quality over time: curves of a table's lines, and comparison at equal PSNR."""

from __future__ import annotations

import pytest

from app.lab.ablation.curves import curve_lines, curves_of, seconds_to
from app.lab.ablation.variants import VARIANTS, rank, variant_called, with_source_steps
from engine.errors import ProjectError
from tests.app.lab.ablation.runs import BY_NAME


def line(name: str, seconds: float, psnr: float | None) -> dict:
    return {"variant": name, "later_s": seconds, "later_psnr": psnr, "later_psnr_moving": None}


def test_a_time_between_two_points_is_interpolated_on_its_logarithm():
    points = [(40.0, 29.0), (10.0, 27.0), (20.0, 26.0)]  # the middle one is worse than what came before
    assert seconds_to(points, 28.0) == pytest.approx(20.0)
    assert seconds_to(points, 29.0) == pytest.approx(40.0)
    assert seconds_to(points, 20.0) == 10.0
    assert seconds_to(points, 29.1) is None
    assert seconds_to([], 29.1) is None


def test_variants_are_compared_at_the_best_psnr_that_both_reach():
    lines = [line("full-steps10", 10.0, 28.0), line("full-steps40", 40.0, 30.0),
             line("published-steps10", 100.0, 27.0), line("published-steps40", 400.0, 29.0)]  # fmt: skip
    full, published = curves_of(lines)
    assert (full["variant"], published["variant"]) == ("full", "published")
    assert "at_equal" not in full
    equal = published["at_equal"]["later_psnr"]
    assert equal == {
        "psnr": 29.0, "seconds": pytest.approx(400.0), "seconds_full": pytest.approx(20.0),
        "ratio": pytest.approx(20.0), "is_least": False,
    }  # fmt: skip
    assert published["at_equal"]["later_psnr_moving"] is None
    assert curve_lines([full, published]) == [
        "published: PSNR of 29.00 dB after 400 s a clip, full after 20 s: 20.0 times as long"
    ]


def test_where_full_begins_above_the_ratio_is_a_least_one():
    lines = [line("full-steps10", 10.0, 29.5), line("full-steps40", 40.0, 30.0),
             line("published-steps10", 100.0, 27.0), line("published-steps40", 400.0, 29.0)]  # fmt: skip
    _, published = curves_of(lines)
    assert published["at_equal"]["later_psnr"]["is_least"]
    assert published["at_equal"]["later_psnr"]["ratio"] == 40.0
    assert "full after at most 10 s: at least 40.0 times" in curve_lines([published])[0]


def test_where_the_other_one_begins_above_nothing_is_said():
    lines = [line("full-steps10", 10.0, 20.0), line("full-steps40", 40.0, 21.0),
             line("published-steps10", 100.0, 27.0), line("published-steps40", 400.0, 29.0)]  # fmt: skip
    curves = curves_of(lines)
    assert curves[1]["at_equal"]["later_psnr"] is None  # it may have had 21 dB after ten seconds, too
    assert curve_lines(curves) == []


def test_one_point_or_a_line_without_a_time_is_no_curve():
    assert curves_of([line("full-steps10", 10.0, 28.0), line("full", 5.0, 20.0), line("full-steps20", 0.0, 1.0)]) == []
    two = curves_of(
        [line("full-steps10", 10.0, None), line("full-steps20", 20.0, 25.0), line("published-steps1", 1, 2)]
    )
    assert [curve["variant"] for curve in two] == ["full"]


def test_a_variant_with_a_number_of_steps_is_known_by_its_name():
    for variant in VARIANTS:
        assert variant_called(variant.name) is variant
        if variant.cut != "clips" or variant.overrides.get("independent"):
            assert variant_called(f"{variant.name}-steps5") is None
            with pytest.raises(ProjectError, match="has no source clips"):
                with_source_steps(variant, 5)
            continue
        derived = with_source_steps(variant, 5)
        assert derived.overrides == variant.overrides | {"source_steps": 5}
        assert derived.family == variant.family
        assert variant_called(derived.name) == derived
        assert rank(variant.name) < rank(derived.name) < rank(f"{variant.name}-steps40")
    assert variant_called("nonsense-steps5") is None
    assert variant_called("full-steps0") is None
    assert with_source_steps(BY_NAME["published"], 5).family == "published"
    assert with_source_steps(BY_NAME["published-tiles"], 5).family == "published-gate"
