"""The numbers that the source paper prints agree with each other."""

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


def test_the_counts_of_the_five_classes_add_up_to_all_simulations():
    assert sum(quoted(f"count_{name}") for name in CLASSES) == quoted("design_simulations") == 276


def test_simulations_without_overtaking_time_are_the_three_classes_without_success():
    classes_without_time = (CLASSES[0], CLASSES[3], CLASSES[4])
    assert sum(quoted(f"count_{name}") for name in classes_without_time) == quoted("ot_zero")


def test_printed_speed_differences_follow_from_the_printed_mean_speeds():
    assert quoted("dsep_unsuccess_col") == pytest.approx(
        quoted("se_unsuccess_col") - quoted("sp_unsuccess_col")
    )
    printed_gains = (quoted("dsep_success_i"), quoted("dsep_success_l"))
    for name in ("success_i", "success_l"):
        gain = quoted(f"se_{name}") - quoted(f"sp_{name}")
        assert min(printed_gains) - 0.05 <= gain <= max(printed_gains) + 0.05


@pytest.mark.parametrize("name", ["no_attempt", "success_l", "unsuccess_col"])
def test_a_printed_time_headway_is_mean_distance_over_mean_speed(name: str):
    speed = statements()[f"se_{name}"].stated.number
    assert quoted(f"headway_{name}") == pytest.approx(quoted(f"d_{name}") / speed, abs=0.005)


def test_a_speed_is_stored_in_si_and_quoted_in_kilometres_per_hour():
    statement = statements()["se_success_i"]
    assert statement.stated.number == pytest.approx(mps_from_kmh(84.32))
    assert (statement.quoted, statement.unit, statement.resolution) == (
        84.32,
        "km/h",
        pytest.approx(0.005),
    )


def test_only_counts_and_mean_se_sp_and_d_are_calibrated():
    fitted = [
        statement
        for statement in statements().values()
        if statement.standing == StatementRole.CALIBRATED
    ]
    allowed = {(Statistic.COUNT, ""), *((Statistic.MEAN, name) for name in ("SE", "SP", "D"))}
    assert {(statement.measure, statement.feature) for statement in fitted} == allowed


def test_every_role_of_a_statement_occurs_and_has_a_meaning():
    assert {statement.standing for statement in statements().values()} == set(StatementRole)
    assert all(role.meaning for role in StatementRole)


def test_the_seeds_of_the_calibration_are_whole_numbers():
    assert calibration().seeds
    assert all(seed == int(seed) for seed in calibration().seeds)
