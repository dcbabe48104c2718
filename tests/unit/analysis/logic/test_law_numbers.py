"""The logic programs contain the same numbers as the rules in Python."""

from __future__ import annotations

import re
from operator import attrgetter

import pytest
from tests.support.logic_law import GERMAN_PROGRAM

from overtaking.analysis.logic.fact_files import PROGRAM_FOLDER
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.judging import LAWS
from overtaking.labels.law.numbers import (
    ABRUPT_BRAKING,
    GAP_REGAIN_TIME,
    LINE_TOLERANCE,
    RETURN_FREE_TIME,
    RETURN_TIME_GAP,
    WINDOW_AFTER,
    WINDOW_BEFORE,
)
from overtaking.model.vehicles import EGO_SLOT

TEXTS = {
    "theory": (PROGRAM_FOLDER / "theory.lp").read_text(encoding="utf-8"),
    "pt": (PROGRAM_FOLDER / "law.lp").read_text(encoding="utf-8"),
    "de": GERMAN_PROGRAM.read_text(encoding="utf-8"),
}
CRITERIA = {rule.code: rule.criterion for law in LAWS.values() for rule in law.rules}

NUMBERS = {
    "theory": {
        "ego": EGO_SLOT,
        "following_time_gap_s": constant("event_detection.phases.follow_time_gap"),
    },
    "pt": {
        "window_before_ms": WINDOW_BEFORE,
        "window_after_ms": WINDOW_AFTER,
        "gap_regain_ms": GAP_REGAIN_TIME,
        "line_tolerance_mm": LINE_TOLERANCE,
        "abrupt_braking_mm_per_s2": ABRUPT_BRAKING,
        "max_lanes_left": ("L1", "max_lanes_left"),
        "queue_min_vehicles": ("L1", "queue_min_vehicles"),
        "queue_reach_mm": ("L1", "queue_reach"),
        "queue_max_speed_mm_per_s": ("L1", "queue_max_speed"),
        "queue_max_speed_gain_mm_per_s": ("L1", "queue_max_speed_gain"),
        "return_time_gap_s": RETURN_TIME_GAP,
        "return_free_time_s": RETURN_FREE_TIME,
        "max_return_delay_ms": ("L9", "max_delay"),
        "min_speed_km_per_h": ("L13", "min_speed"),
        "congestion_min_vehicles": ("L13", "congestion_min_vehicles"),
        "congestion_speed_mm_per_s": ("L13", "congestion_speed"),
        "congestion_time_gap_s": ("L13", "queue_time_gap"),
        "min_border_distance_mm": ("L16", "min_border_distance"),
        "approach_length_mm": ("L17", "approach_length"),
        "indication_before_ms": ("L18", "time_before"),
        "indication_after_ms": ("L18", "time_after"),
        "truck_min_lanes": ("L20", "min_lanes"),
        "truck_open_lanes": ("L20", "num_open_lanes"),
        "oncoming_time_s": ("L24", "min_time"),
        "encroachment_time_s": ("L24", "min_pet"),
        "reaction_reach_s": ("L26", "max_meeting_time"),
        "slow_speed_km_per_h": ("L28", "max_speed"),
        "slow_vehicle_gap_mm": ("L28", "min_gap"),
    },
    "de": {
        "min_time_gap_ms": ("A1", "min_time"),
        "fined_min_speed_km_per_h": ("A2", "min_speed"),
        "fined_time_gap_ms": ("A2", "min_time"),
        "fined_duration_ms": ("A2", "max_duration"),
        "fined_distance_mm": ("A2", "max_distance"),
        "truck_min_speed_km_per_h": ("A3", "min_speed"),
        "truck_gap_mm": ("A3", "min_gap"),
        "car_length_mm": ("A4", "vehicle_length"),
        "min_speed_gain_km_per_h": ("O2", "min_speed_gain"),
        "level_crossing_approach_mm": ("O17", "level_approach_length"),
    },
}
"""The number in SI of each constant of a program: a value, or the field of a rule's criterion."""

UNITS = {"_mm": 1000.0, "_mm_per_s": 1000.0, "_mm_per_s2": 1000.0, "_ms": 1000.0, "_km_per_h": 3.6}
"""Suffixes of names of constants, and their number of units per SI unit; without one: SI."""


@pytest.mark.parametrize("program", TEXTS)
def test_every_constant_of_a_program_equals_the_number_of_the_package(program: str):
    values = dict(re.findall(r"^#const (\w+) = (\d+)\.", TEXTS[program], re.MULTILINE))
    assert set(values) == set(NUMBERS[program])
    for name, value in values.items():
        number = NUMBERS[program][name]
        if isinstance(number, tuple):
            code, field = number
            number = getattr(CRITERIA[code], field)
        suffix = max((unit for unit in UNITS if name.endswith(unit)), key=len, default="")
        assert int(value) == pytest.approx(float(number) * UNITS.get(suffix, 1.0), rel=1e-6), name


@pytest.mark.parametrize(
    ("law", "predicate", "code"),
    [("pt", "general_limit", "L12"), ("de", "german_general_limit", "V2")],
)
def test_the_general_speed_limits_of_a_program_equal_the_limits_of_its_rule(
    law: str, predicate: str, code: str
):
    limits = re.findall(rf"\b{predicate}\((\w+),(\w+),(\d+)\)", TEXTS[law])
    assert len(limits) == 9  # Three kinds of road, three classes of vehicle.
    for road, vehicle, limit in limits:
        number = attrgetter(f"general_limits.{road}.{vehicle}")(CRITERIA[code])
        assert int(limit) == pytest.approx(3.6 * float(number), rel=1e-6), (road, vehicle)
