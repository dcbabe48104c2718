"""Texts of conditions."""

from __future__ import annotations

import pytest

from overtaking.analysis.learning.attributes import (
    ATTRIBUTES,
    BY_NAME,
    DERIVED,
    FACTORS,
    UNITS,
)
from overtaking.analysis.learning.conditions import Condition
from overtaking.analysis.learning.wording import condition_text, rounded
from overtaking.data.tables.schemas import SCHEMAS


@pytest.mark.parametrize(
    ("name", "value", "is_least", "text"),
    [
        ("left_follower_gap_m", 28.0, False, "gap to the vehicle behind on the left below 28 m"),
        (
            "left_follower_gap_m",
            28.0,
            True,
            "gap to the vehicle behind on the left at least 28 m (or nobody is behind on the left)",
        ),
        (
            "left_follower_closing_speed_mps",
            12.0 / 3.6,
            True,
            "the vehicle behind on the left is faster by at least 12 km/h",
        ),
        (
            "left_follower_closing_speed_mps",
            -9.0 / 3.6,
            False,
            "the vehicle behind on the left is slower by more than 9 km/h "
            "(or nobody is behind on the left)",
        ),
        ("over_limit", 0.0, True, "the ego is above its limit"),
        ("over_limit", 0.0, False, "the ego is below its limit"),
        (
            "over_limit",
            -5.0 / 3.6,
            True,
            "the ego is below its limit by at most 5 km/h, or above its limit",
        ),
        (
            "over_limit",
            5.0 / 3.6,
            False,
            "the ego is above its limit by less than 5 km/h, or below its limit",
        ),
        ("leader_accel_mps2", -0.6, False, "acceleration of the vehicle ahead below −0.6 m/s²"),
        ("night", 1.0, True, "it is night"),
        ("night", 1.0, False, "it is day"),
        ("night", 0.0, True, "it is day"),
        ("leader_kind", 4.0, True, "the vehicle ahead is a truck"),
        ("leader_kind", 6.0, False, "the vehicle ahead is not a bicycle"),
        ("lane", 1.0, False, "number of lanes to the right below 1"),
    ],
)
def test_a_condition_has_a_text_in_plain_words(name: str, value: float, is_least: bool, text: str):
    assert condition_text(BY_NAME[name], value, is_least=is_least) == text


def test_values_are_rounded_in_the_unit_of_their_text():
    assert rounded(33.2, "km/h") * 3.6 == pytest.approx(120.0)
    assert rounded(0.04, "s") == 0.0
    assert rounded(0.5, "n") == 1


def test_every_attribute_has_a_unit_and_comes_from_the_table_of_decisions():
    columns = set(SCHEMAS["attempts"].names)
    for attribute in ATTRIBUTES:
        assert attribute.scale.unit in UNITS
        assert attribute.name in columns or attribute.name in DERIVED, attribute.name
        assert not attribute.name.startswith("believed")


def test_every_attribute_belongs_to_one_factor():
    names = [name for attributes in FACTORS.values() for name in attributes]
    assert sorted(names) == sorted(BY_NAME)


def test_the_text_of_a_condition_contains_its_exact_border():
    """A reader can apply the condition because the text contains every digit of the border."""
    border = rounded(12.3456, "m")
    condition = Condition(attribute=BY_NAME["leader_gap_m"], value=border, is_least=False)
    assert condition.text == f"gap to the vehicle ahead below {border:g} m"
