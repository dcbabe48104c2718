"""The numbers of the source paper agree with what the paper's arithmetic makes of them."""

from __future__ import annotations

import pytest

from overtaking.analysis.reproduction.statements import (
    StatementRole,
    Statistic,
    calibration,
    statements,
)
from overtaking.core.units import mps_from_kmh

CLASSES = ("no_attempt", "success_i", "success_l", "unsuccess_col", "unsuccess_ncol")


def quoted(name: str) -> float:
    return statements()[name].quoted


def test_the_classes_are_all_simulations():
    assert sum(quoted(f"count_{name}") for name in CLASSES) == quoted("design_simulations") == 276


def test_who_has_no_overtaking_time_is_three_classes_together():
    together = (CLASSES[0], CLASSES[3], CLASSES[4])
    assert sum(quoted(f"count_{name}") for name in together) == quoted("ot_zero")


def test_differences_are_those_of_the_printed_means():
    assert quoted("dsep_unsuccess_col") == pytest.approx(
        quoted("se_unsuccess_col") - quoted("sp_unsuccess_col")
    )
    gains = (quoted("dsep_success_i"), quoted("dsep_success_l"))
    for name in ("success_i", "success_l"):
        gain = quoted(f"se_{name}") - quoted(f"sp_{name}")
        assert min(gains) - 0.05 <= gain <= max(gains) + 0.05


@pytest.mark.parametrize("name", ["no_attempt", "success_l", "unsuccess_col"])
def test_headways_are_distance_over_speed(name: str):
    speed = statements()[f"se_{name}"].stated.number
    assert quoted(f"headway_{name}") == pytest.approx(quoted(f"d_{name}") / speed, abs=0.005)


def test_a_speed_is_kept_in_si_and_shown_as_printed():
    one = statements()["se_success_i"]
    assert one.stated.number == pytest.approx(mps_from_kmh(84.32))
    assert (one.quoted, one.unit, one.resolution) == (84.32, "km/h", pytest.approx(0.005))


def test_only_what_may_be_fitted_is_called_calibrated():
    fitted = [one for one in statements().values() if one.standing == StatementRole.CALIBRATED]
    allowed = {(Statistic.COUNT, ""), *((Statistic.MEAN, name) for name in ("SE", "SP", "D"))}
    assert {(one.measure, one.feature) for one in fitted} == allowed


def test_every_standing_is_met_and_has_a_meaning():
    assert {one.standing for one in statements().values()} == set(StatementRole)
    assert all(one.meaning for one in StatementRole)


def test_the_seeds_of_the_calibration_are_whole_numbers():
    assert calibration().seeds
    assert all(seed == int(seed) for seed in calibration().seeds)
