"""How far a step of motion is from the truth: drives without a driver, and with one.

`python -m tests.support.drives` prints the tables of docs/explanation/model.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from overtaking.sim.reference import steering

from .bench import DECISION, Bench, bench
from .single_track import Drive, integrated
from .worlds import FOUR_WHEELERS, Vehicle, body_of

UNTIL = 2.0
"""Length of a drive without a driver [s]."""

LONG = 8.0
"""Length of a drive with a driver [s]."""

FINE = 0.001
"""Step of the truth with a driver in the loop [s]."""

CROSS_WIND = {"wind": 100.0, "wind_direction": math.pi / 2.0}
"""20 m/s from the right."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A drive without a driver.

    Attributes:
        drive: What is done to the vehicle.
        names: What is compared.
        speeds: Speeds at the start [km/h].
        sky: Differences of the weather from a clear sky.
        swings: Whether what is compared comes back to where it began.
    """

    drive: Drive
    names: str
    speeds: tuple[float, ...]
    sky: dict[str, float] | None = None
    swings: bool = False


OPEN = {
    "wheel held at 0.01": Case(
        drive=Drive(wheel=lambda _: 0.01), names="d heading yaw_rate s", speeds=(100, 50, 15)
    ),
    "wheel held at 0.02": Case(
        drive=Drive(wheel=lambda _: 0.02), names="d heading yaw_rate s", speeds=(100, 50, 15)
    ),
    "wheel 0.02 sin, 0.5 Hz": Case(
        drive=Drive(wheel=lambda t: 0.02 * math.sin(math.pi * t)),
        names="d heading yaw_rate",
        speeds=(100, 50, 15),
        swings=True,
    ),
    "braking in a turn, friction 0.9": Case(
        drive=Drive(wheel=lambda _: 0.012, accel=lambda _: -3.5),
        names="d heading yaw_rate s vx",
        speeds=(100, 50),
    ),
    "braking in a turn, friction 0.5": Case(
        drive=Drive(wheel=lambda _: 0.012, accel=lambda _: -3.5, friction=0.5),
        names="d heading yaw_rate s vx",
        speeds=(100, 50),
    ),
    "full braking, friction 0.3": Case(
        drive=Drive(accel=lambda _: -9.0, friction=0.3), names="s vx", speeds=(100, 50)
    ),
    "sliding, friction 0.35": Case(
        drive=Drive(wheel=lambda t: min(0.2 * t, 0.06), friction=0.35),
        names="d heading yaw_rate",
        speeds=(100, 50, 15),
    ),
    "sudden side wind of 20 m/s": Case(
        drive=Drive(wind=20.0), names="d heading yaw_rate", speeds=(100, 50, 15), sky=CROSS_WIND
    ),
    "full throttle from rest": Case(drive=Drive(accel=lambda _: 9.0), names="s vx", speeds=(0,)),
    "full throttle from rest, friction 0.3": Case(
        drive=Drive(accel=lambda _: 9.0, friction=0.3), names="s vx", speeds=(0,)
    ),
    "full throttle in a turn": Case(
        drive=Drive(wheel=lambda _: 0.03, accel=lambda _: 9.0),
        names="d heading yaw_rate s vx",
        speeds=(36, 15),
    ),
}
"""Drives without a driver, for four wheels."""


def driven(kind: str, case: Case, kmh: float, step: float = DECISION) -> dict[str, np.ndarray]:
    """What the model does, by name and time."""
    test = bench(
        Vehicle(kind=kind, speed=kmh / 3.6), friction=case.drive.friction, sky=case.sky, step=step
    )

    def action(b: Bench, time: float) -> None:
        b.hold(wheel=case.drive.wheel(time), accel=case.drive.accel(time))

    ran = test.drive(UNTIL, action)
    return {name: rows[:, 0] if rows.ndim > 1 else rows for name, rows in ran.items()}


@cache
def truth(kind: str, label: str, kmh: float) -> dict[str, np.ndarray]:
    """What SciPy says, every 50 ms."""
    times = np.arange(round(UNTIL / DECISION) + 1) * DECISION
    return integrated(body_of(kind), (0.0, 0.0, kmh / 3.6), OPEN[label].drive, times)


def open_error(kind: str, label: str, kmh: float, step: float = DECISION) -> tuple[float, str]:
    """Largest difference from SciPy, and of what.

    It is that after 1 and after 2 s, as a share of how far the value has moved by then; where it
    swings, of how far it has moved at most.
    """
    case, theirs = OPEN[label], truth(kind, label, kmh)
    ours = driven(kind, case, kmh, step)
    every, found = round(1.0 / step), (0.0, "")
    for name in case.names.split():
        moved = ours[name][::every] - ours[name][0]
        expected = theirs[name] - theirs[name][0]
        floor = np.abs(expected).max() if case.swings else 0.0
        for second in (1, 2):
            wanted = expected[round(second / DECISION)]
            share = abs(moved[second] - wanted) / max(abs(wanted), floor)
            found = max(found, (float(share), f"{kind} {name} {second} s"))
    return found


@dataclass(frozen=True, kw_only=True)
class Loop:
    """A lane change of 3.5 m with the driver's steering in the loop.

    Attributes:
        friction: Peak friction.
        duration: Of the lane change [s].
        accel: Acceleration asked for [m/s^2].
        gust: Side wind between 2 and 5 s [m/s].
        speeds: Speeds at the start [km/h].
    """

    friction: float = 0.9
    duration: float = 4.0
    accel: float = 0.0
    gust: float = 0.0
    speeds: tuple[float, ...] = (25, 60, 100, 140)


CLOSED = {
    "dry, 4 s": Loop(),
    "friction 0.5, 4 s": Loop(friction=0.5),
    "friction 0.25, 3 s": Loop(friction=0.25, duration=3.0),
    "braking with 3 m/s^2": Loop(accel=-3.0, speeds=(60, 100, 140)),
    "gust of 12 m/s": Loop(gust=12.0),
}
"""Drives with a driver."""

KEPT = ("d", "heading", "yaw_rate")

LOOPED = tuple(
    (label, kind, kmh)
    for label, loop in CLOSED.items()
    for kmh in loop.speeds
    for kind in (*FOUR_WHEELERS, "MC")
    if kind != "T" or kmh <= 100.0
)
"""Drives with a driver: label, class and speed at the start [km/h]; lorries are not faster."""


def of_each(name: str) -> np.ndarray:
    """A number of `Loop` for each of `LOOPED`."""
    return np.array([getattr(CLOSED[label], name) for label, _, _ in LOOPED], np.float32)


def looped(step: float) -> np.ndarray:
    """Place, heading and yaw rate of `LOOPED`, side by side, shape (drive, time, 3)."""
    friction, gust = of_each("friction"), of_each("gust")
    test = bench(
        *[Vehicle(kind=kind, speed=kmh / 3.6) for _, kind, kmh in LOOPED],
        friction=friction.tolist(),
        step=step,
    )
    state, zero = test.state, np.zeros_like(test.state.motion.s)
    changes = zero == 0
    steering.start_path(
        state, changes, state.motion.d + np.float32(3.5), zero + of_each("duration")
    )
    most = np.minimum(np.float32(4.0), np.float32(0.7 * 9.81) * friction)
    state.controls.requested_accel = zero + of_each("accel")
    rows = []
    decision = round(DECISION / step)
    at_decisions = replace(test.params, constants=test.constants.replace(decision=DECISION))
    for k in range(round(LONG / step)):
        if k % decision == 0:
            rows.append([getattr(state.motion, name)[0].copy() for name in KEPT])
            blow(test, gust if 2.0 <= k * step < 5.0 - 1e-6 else np.zeros_like(gust))
            steering.update_wind_trim(state, at_decisions, k)
        test.move(test.steer(np.full_like(test.simulations.max_lateral_accel, most)))
    return np.array(rows).transpose(2, 0, 1)


def blow(test: Bench, wind: np.ndarray) -> None:
    """Let side winds push from here on, by the formulas of the model."""
    speed = np.maximum(test.state.motion.vx, np.float32(1.0))
    angle = np.arctan2(wind, speed)
    pressure = speed * speed + wind * wind
    lift = np.sin(np.minimum(np.float32(1.2) * angle, np.float32(0.5 * math.pi)))
    test.state.friction_and_wind.wind_force = test.vehicles.side_wind * pressure * lift
    arm = test.vehicles.wind_centre * np.cos(angle) + test.vehicles.wind_arm
    test.state.friction_and_wind.wind_moment = test.state.friction_and_wind.wind_force * arm


@cache
def farthest() -> np.ndarray:
    """Largest distance of each of `LOOPED` from steps of a millisecond, shape (drive, 3)."""
    return np.abs(looped(DECISION) - looped(FINE)).max(axis=1)


def closed_errors(
    label: str, kinds: tuple[str, ...] = tuple(FOUR_WHEELERS)
) -> dict[float, np.ndarray]:
    """Largest distance from steps of a millisecond by speed of what is `KEPT` [m, rad, rad/s]."""
    return {
        kmh: np.max(
            [
                away
                for away, (of, kind, start) in zip(farthest(), LOOPED, strict=True)
                if of == label and kind in kinds and start == kmh
            ],
            axis=0,
        )
        for kmh in CLOSED[label].speeds
    }


def main() -> None:
    """Print both tables."""
    for label, case in OPEN.items():
        for kmh in case.speeds:
            share, where = max(open_error(kind, label, kmh) for kind in FOUR_WHEELERS)
            print(f"| {label} | {kmh:.0f} | {100 * share:.2f} | {where} |")
    for label in CLOSED:
        for kmh, worst in closed_errors(label).items():
            d, psi, r = 1000.0 * worst
            print(f"| {label} | {kmh:.0f} | {d:.1f} | {psi:.2f} | {r:.2f} |")


if __name__ == "__main__":
    main()
