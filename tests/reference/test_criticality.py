"""Surrogate measures of safety against CommonRoad-CriMe 0.4.5.

`benchmarks/oracles/commonroad_crime.py` made the table, in an environment of its own; it says which
traits of that version limit the comparison.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from overtaking.world.surrogate_safety import (
    drac,
    is_ttc_critical,
    mttc,
    time_gap,
    ttc,
    ttc_shortfall,
)

TABLE = Path(__file__).parents[1] / "data" / "commonroad_crime.csv"
STEP, STEPS, THRESHOLD = 0.1, 40, np.float32(3.0)


def scenes() -> list[dict[str, float]]:
    with TABLE.open(encoding="utf-8", newline="") as file:
        return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]


SCENES = scenes()
STEADY = [scene for scene in SCENES if scene["ego_accel_mps2"] == scene["leader_accel_mps2"] == 0.0]


def course(scene: dict[str, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gap, closing speed and closing acceleration in each frame that CriMe adds up."""
    time = np.arange(STEPS) * STEP
    accel = scene["ego_accel_mps2"] - scene["leader_accel_mps2"]
    closing = scene["ego_speed_mps"] - scene["leader_speed_mps"] + accel * time
    start = scene["ego_speed_mps"] - scene["leader_speed_mps"]
    gap = scene["gap_m"] - start * time - 0.5 * accel * time * time
    return (
        gap.astype(np.float32),
        closing.astype(np.float32),
        np.full(STEPS, accel, np.float32),
    )


def times_to_collision(scene: dict[str, float]) -> np.ndarray:
    """Times to collision at constant accelerations, in each frame of `course`."""
    return mttc(*course(scene))


@pytest.mark.parametrize("scene", SCENES)
def test_the_time_to_collision_at_constant_accelerations_equals_crime(scene):
    assert times_to_collision(scene)[0] == pytest.approx(scene["ttc"], abs=0.0051)


@pytest.mark.parametrize("scene", STEADY)
def test_the_time_to_collision_without_acceleration_equals_crime(scene):
    gap, closing, _ = course(scene)
    assert ttc(gap, closing)[0] == pytest.approx(scene["ttc"], abs=0.0051)


@pytest.mark.parametrize(
    "scene",
    [
        scene
        for scene in SCENES
        if scene["leader_accel_mps2"] == 0.0 and scene["ego_speed_mps"] >= scene["leader_speed_mps"]
    ],
)
def test_the_deceleration_that_avoids_a_collision_equals_crime(scene):
    gap, closing, _ = course(scene)
    assert -drac(gap, closing)[0] == pytest.approx(scene["required_accel"], abs=0.0051)


@pytest.mark.parametrize("scene", STEADY)
def test_the_time_gap_equals_crime_up_to_a_frame(scene):
    measured = float(time_gap(np.float32(scene["gap_m"]), np.float32(scene["ego_speed_mps"])))
    # CriMe gives the first frame after the ego passed the position.
    assert scene["time_gap"] - STEP - 1e-4 <= measured <= scene["time_gap"] + 1e-4


@pytest.mark.parametrize("scene", SCENES)
def test_the_exposed_time_equals_crime(scene):
    # CriMe compares values rounded to 0.01 s.
    rounded = np.round(times_to_collision(scene), 2)
    exposed = is_ttc_critical(rounded, THRESHOLD).sum() * STEP
    assert exposed == pytest.approx(scene["time_exposed"], abs=1e-6)


@pytest.mark.parametrize("scene", SCENES)
def test_the_integrated_time_equals_crime(scene):
    integrated = ttc_shortfall(times_to_collision(scene), THRESHOLD).sum() * STEP
    assert integrated == pytest.approx(scene["time_integrated"], abs=0.005 * STEPS * STEP)


def test_the_table_has_scenes_of_every_kind():
    assert any(np.isinf(scene["ttc"]) for scene in SCENES)
    assert any(scene["time_exposed"] > 0 for scene in SCENES)
    assert any(scene["ego_accel_mps2"] < 0 for scene in SCENES)
