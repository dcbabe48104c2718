"""Measures of nearness against motion that is worked out step by step, and against known tables."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from overtaking.world.surrogate_safety import (
    assumed_decel,
    drac,
    mttc,
    picud,
    rss_safe_gap,
    safe_distance,
    time_gap,
    time_headway,
    ttc,
)

F = np.float32
KMH = 1.0 / 3.6
FINE = 1e-3  # Step of the motions below [s].

speeds = st.floats(0.5, 45.0, width=32)
gaps = st.floats(0.5, 200.0, width=32)
# Of these as many digits as are recorded.
closings = st.integers(-20_000, 20_000).map(lambda mmps: mmps / 1000.0)
accels = st.integers(-8_000, 8_000).map(lambda mmps2: mmps2 / 1000.0)


def sudden_braking(rear: float, lead: float, gap: float, *, delay: float, decel: float) -> float:
    """Smallest gap when the leader brakes to a stop at once and the rear after a delay [m]."""
    t = np.arange(0.0, delay + 50.0 / decel + 1.0, FINE)
    return float(np.min(gap + way(lead, t, 0.0, decel) - way(rear, t, delay, decel)))


def way(speed: float, t: np.ndarray, delay: float, decel: float) -> np.ndarray:
    """Distance of a vehicle that brakes from `delay` on until it stands [m]."""
    braking = np.clip(t - delay, 0.0, speed / decel)
    return speed * np.minimum(t, delay) + speed * braking - 0.5 * decel * braking**2


@given(rear=speeds, lead=speeds, delay=st.floats(0.0, 2.0), decel=st.floats(1.0, 9.0))
def test_at_the_safe_distance_two_vehicles_just_do_not_touch(rear, lead, delay, decel):
    needed = float(
        safe_distance(
            F(rear), F(lead), reaction_time=F(delay), follower_decel=F(decel), leader_decel=F(decel)
        )
    )
    if lead > rear:
        needed = max(needed, float(rear * delay))  # Until it reacts a slower one cannot touch.
    left = sudden_braking(rear, lead, needed, delay=delay, decel=decel)
    assert left >= -0.02
    if needed > 0.0 and rear >= lead:
        assert left <= 0.02


@pytest.mark.parametrize(
    ("rear_kmh", "lead_kmh", "monitor", "human", "rss"),
    [(120.0, 120.0, 13.0, 33.0, 135.0), (120.0, 90.0, 36.0, 64.0, 166.0)],
)
def test_the_published_distances_of_three_rules_are_met(rear_kmh, lead_kmh, monitor, human, rss):
    rear, lead = F(rear_kmh * KMH), F(lead_kmh * KMH)
    set_of = {"reaction_time": F(0.3), "follower_decel": F(10.0), "leader_decel": F(10.5)}
    assert abs(float(safe_distance(rear, lead, **set_of)) - monitor) < 0.6
    b = assumed_decel(F(0.95), share=F(0.9), limit=F(8.0), gravity=F(9.81))
    legal = safe_distance(rear, lead, reaction_time=F(1.0), follower_decel=b, leader_decel=b)
    assert abs(float(legal) - human) < 0.6
    strict = rss_safe_gap(
        rear, lead, reaction_time=F(1.0), accel=F(3.5), follower_decel=F(4.0), leader_decel=F(8.0)
    )
    assert abs(float(strict) - rss) < 0.6


@given(gap=gaps, closing=closings, accel=accels)
def test_ttc_with_accelerations_is_the_first_root_of_the_parabola(gap, closing, accel):
    roots = np.roots([0.5 * accel, closing, -gap]) if abs(accel) > 1e-3 else np.array([])
    real = [root.real for root in roots if abs(root.imag) < 1e-9 and root.real > 0]
    square = closing**2 + 2.0 * accel * gap
    if abs(accel) <= 1e-3 or abs(square) < 1e-3 * (closing**2 + 1.0):
        return  # A straight line, below; or a touch, which rounding decides.
    got = float(mttc(F(gap), F(closing), F(accel)))
    assert got == pytest.approx(min(real), rel=1e-4) if real else got == np.inf


@given(gap=gaps, closing=closings)
def test_ttc_is_that_of_accelerations_that_are_nil(gap, closing):
    plain, full = ttc(F(gap), F(closing)), mttc(F(gap), F(closing), F(0.0))
    assert plain == pytest.approx(full, rel=1e-5)
    assert (plain == np.inf) == (closing <= 0)


@given(gap=gaps, closing=st.floats(0.125, 20.0, width=32))
def test_braking_at_drac_ends_the_approach_at_the_bumper(gap, closing):
    needed = float(drac(F(gap), F(closing)))
    time = closing / needed
    assert closing * time - 0.5 * needed * time**2 == pytest.approx(gap, rel=1e-4)


def test_measures_of_two_that_overlap_are_those_of_a_collision():
    assert ttc(F(-1.0), F(-3.0)) == 0.0
    assert mttc(F(-1.0), F(-3.0), F(-1.0)) == 0.0
    assert time_gap(F(-1.0), F(20.0)) == 0.0
    assert drac(F(-1.0), F(3.0)) == np.inf
    assert drac(F(-1.0), F(-3.0)) == 0.0


def test_a_gap_that_opens_is_never_closed():
    assert ttc(F(5.0), F(-0.1)) == np.inf
    assert ttc(F(5.0), F(0.0)) == np.inf
    assert mttc(F(5.0), F(2.0), F(-1.0)) == np.inf
    assert drac(F(5.0), F(-0.1)) == 0.0
    assert time_gap(F(5.0), F(0.0)) == np.inf


def test_what_hardly_moves_takes_for_ever_without_an_overflow():
    slow = F(1e-30)
    assert time_gap(F(5.0), slow) == ttc(F(5.0), slow) == mttc(F(5.0), slow, F(0.0)) == np.inf


def test_headway_counts_the_vehicle_ahead_and_time_gap_does_not():
    assert time_gap(F(30.0), F(20.0)) == 1.5
    assert time_headway(F(30.0), F(5.0), F(20.0)) == 1.75


@given(rear=speeds, lead=speeds, gap=gaps)
def test_picud_is_the_margin_to_the_safe_distance(rear, lead, gap):
    b = {"reaction_time": F(1.0), "follower_decel": F(7.0), "leader_decel": F(7.0)}
    margin = float(picud(F(gap), F(rear), F(lead), **b))
    needed = float(safe_distance(F(rear), F(lead), **b))
    assert (margin >= 0) == (gap >= needed) or abs(margin) < 1e-3
    assert margin == pytest.approx(gap - needed, abs=1e-3) or needed == 0.0


def test_measures_stay_float32():
    a = np.full(3, 10.0, np.float32)
    for value in (time_gap(a, a), ttc(a, a), mttc(a, a, a), drac(a, a), time_headway(a, a, a)):
        assert value.dtype == np.float32


def test_usable_deceleration_follows_friction_up_to_its_limit():
    friction = np.array([0.3, 0.85, 1.0], np.float32)
    got = assumed_decel(friction, share=F(0.9), limit=F(8.0), gravity=F(9.81))
    assert got == pytest.approx([2.6487, 7.50465, 8.0])
