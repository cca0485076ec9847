"""Numbers in input fields: three digits, and never an exponent."""

import pytest

from ui.style.numbers import number_format


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.5, "0.500"), (12.345, "12.3"), (22000.0, "22000"), (6.621e-7, "0.00000066"), (-0.02, "-0.0200")],
)
def test_an_input_field_shows_no_exponent(value: float, text: str) -> None:
    assert number_format(value) % value == text


def test_a_field_shows_nothing_finer_than_its_range_needs() -> None:
    assert number_format(2.38e-5, 0.001) % 2.38e-5 == "0.000"
    assert number_format(0.998, 0.001) % 0.998 == "0.998"
