"""The three durations of a lane change and its largest lateral speed, on analytic paths."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from overtaking.analysis.validation import paths

FRAME_INTERVAL_S, HALF_FRAMES, WIDTH, SHIFT = 0.05, 400, 1.8, 3.5
VISIBLE_SPEED = 0.15
"""Lateral speed of visible motion [m/s]."""


def times() -> np.ndarray:
    """Time from the middle of the change, shape (frame,) [s]."""
    return FRAME_INTERVAL_S * np.arange(-HALF_FRAMES, HALF_FRAMES + 1)


def quintic(duration: float) -> np.ndarray:
    """A fifth-degree lateral path of `duration` [s] around the line, shape (1, frame) [m]."""
    u = np.clip(times() / duration + 0.5, 0.0, 1.0)
    return (SHIFT * (u**3 * (10.0 - 15.0 * u + 6.0 * u * u) - 0.5))[None, :]


def central_duration(duration: float, excess) -> float:
    """Time between the two zeros of a function that is symmetric about the middle of a quintic [s].

    Args:
        duration: Duration of the quintic [s].
        excess: Function of the elapsed share of the duration.
    """
    first_share = float(brentq(excess, 1e-6, 0.5))  # type: ignore[arg-type]
    return (1.0 - 2.0 * first_share) * duration


def durations(path: np.ndarray) -> tuple[float, ...]:
    """Durations of visible motion, of the body over the line, and until lateral rest [s]."""
    speed = paths.lateral_speed(path, FRAME_INTERVAL_S)
    begin, end = paths.moving(speed)
    crossing_begin, crossing_end = paths.straddling(path, np.array([0.5 * WIDTH]))
    rest_frame = paths.settled(speed, FRAME_INTERVAL_S)
    frames = (end - begin - 1, crossing_end - crossing_begin - 1, rest_frame - begin - 1)
    return tuple(float(number[0]) * FRAME_INTERVAL_S for number in frames)


@pytest.mark.parametrize("duration", [4.0, 6.3, 9.0])
def test_durations_of_a_quintic_path_follow_from_its_polynomial(duration):
    moving, crossing, settled = durations(quintic(duration))
    expected_moving = central_duration(
        duration, lambda u: 30.0 * SHIFT / duration * (u * (1.0 - u)) ** 2 - VISIBLE_SPEED
    )
    expected_crossing = central_duration(
        duration,
        lambda u: SHIFT * (u**3 * (10.0 - 15.0 * u + 6.0 * u * u) - 0.5) + 0.5 * WIDTH,
    )
    # Speeds are taken over half a second, which widens the motion a little.
    assert moving == pytest.approx(expected_moving, abs=0.2)
    assert crossing == pytest.approx(expected_crossing, abs=0.11)
    assert settled == pytest.approx(moving, abs=1e-9)


@pytest.mark.parametrize("duration", [4.0, 6.3, 9.0])
def test_the_largest_speed_of_a_quintic_path_is_15_eighths_of_its_mean_speed(duration):
    speed = paths.lateral_speed(quintic(duration), FRAME_INTERVAL_S)
    peak = paths.peak(speed, *paths.moving(speed))
    assert peak[0] == pytest.approx(1.875 * SHIFT / duration, rel=0.02)


def test_a_path_with_an_overshoot_comes_to_rest_later():
    overshoot_s = 3.0
    u = np.clip((times() - 3.0) / overshoot_s, 0.0, 1.0)
    path = quintic(6.0) + 0.5 * np.sin(np.pi * u) ** 2  # Out and back by half a metre.
    plain_durations, (moving, crossing, settled) = durations(quintic(6.0)), durations(path)
    assert crossing == plain_durations[1]
    # sin(2 pi u) of the speed 0.5 pi / back falls below the limit so long before the end of it.
    rest_s = overshoot_s * (
        1.0 - np.arcsin(VISIBLE_SPEED * overshoot_s / (0.5 * np.pi)) / (2.0 * np.pi)
    )
    assert settled == pytest.approx(0.5 * plain_durations[0] + 3.0 + rest_s, abs=0.25)
    assert moving < settled - 1.0


def test_a_path_that_ends_before_rest_has_no_end_of_motion():
    speed = paths.lateral_speed(quintic(6.0), FRAME_INTERVAL_S)
    speed[:, HALF_FRAMES + 20 :] = np.nan
    begin, end = paths.moving(speed)
    assert begin[0] < HALF_FRAMES
    assert end[0] == HALF_FRAMES
    assert paths.settled(speed, FRAME_INTERVAL_S)[0] == HALF_FRAMES
