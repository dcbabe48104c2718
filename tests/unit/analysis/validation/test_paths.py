"""The three durations of a lane change, and its largest speed, on paths that are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from overtaking.analysis.validation import paths

INTERVAL, REACH, WIDTH, SHIFT = 0.05, 400, 1.8, 3.5
LIMIT = 0.15


def times() -> np.ndarray:
    """Time from the middle of the change, shape (frame,) [s]."""
    return INTERVAL * np.arange(-REACH, REACH + 1)


def quintic(duration: float) -> np.ndarray:
    """A path without jerk at its ends, the line in the middle of its way [m]."""
    u = np.clip(times() / duration + 0.5, 0.0, 1.0)
    return (SHIFT * (u**3 * (10.0 - 15.0 * u + 6.0 * u * u) - 0.5))[None, :]


def share_of(duration: float, holds) -> float:
    """Time from the begin to the end of what holds around the middle of a quintic [s]."""
    begin = float(brentq(holds, 1e-6, 0.5))  # type: ignore[arg-type]
    return (1.0 - 2.0 * begin) * duration


def measured(path: np.ndarray) -> tuple[float, ...]:
    """Visible motion, body over the line, until settled [s]."""
    speed = paths.lateral_speed(path, INTERVAL)
    begin, end = paths.moving(speed)
    over, clear = paths.straddling(path, np.array([0.5 * WIDTH]))
    still = paths.settled(speed, INTERVAL)
    frames = (end - begin - 1, clear - over - 1, still - begin - 1)
    return tuple(float(one[0]) * INTERVAL for one in frames)


@pytest.mark.parametrize("duration", [4.0, 6.3, 9.0])
def test_on_a_quintic_every_duration_is_what_the_polynomial_says(duration):
    moving, crossing, settled = measured(quintic(duration))
    visible = share_of(duration, lambda u: 30.0 * SHIFT / duration * (u * (1.0 - u)) ** 2 - LIMIT)
    over = share_of(
        duration,
        lambda u: SHIFT * (u**3 * (10.0 - 15.0 * u + 6.0 * u * u) - 0.5) + 0.5 * WIDTH,
    )
    # Speeds are taken over half a second, which widens the motion a little.
    assert moving == pytest.approx(visible, abs=0.2)
    assert crossing == pytest.approx(over, abs=0.11)
    assert settled == pytest.approx(moving, abs=1e-9)


@pytest.mark.parametrize("duration", [4.0, 6.3, 9.0])
def test_the_largest_speed_of_a_quintic_is_15_eighths_of_its_mean(duration):
    speed = paths.lateral_speed(quintic(duration), INTERVAL)
    peak = paths.peak(speed, *paths.moving(speed))
    assert peak[0] == pytest.approx(1.875 * SHIFT / duration, rel=0.02)


def test_what_comes_back_after_an_overshoot_settles_later():
    back = 3.0
    u = np.clip((times() - 3.0) / back, 0.0, 1.0)
    path = quintic(6.0) + 0.5 * np.sin(np.pi * u) ** 2  # Out and back by half a metre.
    plain, (moving, crossing, settled) = measured(quintic(6.0)), measured(path)
    assert crossing == plain[1]
    # sin(2 pi u) of the speed 0.5 pi / back falls below the limit so long before the end of it.
    late = back * (1.0 - np.arcsin(LIMIT * back / (0.5 * np.pi)) / (2.0 * np.pi))
    assert settled == pytest.approx(0.5 * plain[0] + 3.0 + late, abs=0.25)
    assert moving < settled - 1.0


def test_a_path_that_is_cut_off_has_no_duration():
    speed = paths.lateral_speed(quintic(6.0), INTERVAL)
    speed[:, REACH + 20 :] = np.nan
    begin, end = paths.moving(speed)
    assert begin[0] < REACH
    assert end[0] == REACH
    assert paths.settled(speed, INTERVAL)[0] == REACH
