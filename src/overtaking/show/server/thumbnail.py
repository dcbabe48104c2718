"""A simulation as a small diagram: where others are along the road from the ego, over time."""

from __future__ import annotations

from typing import Any

import numpy as np

POINTS = 48
REACH_M = 80.0
"""Ahead and behind; who is farther is not drawn [m]."""

_MM = 1000.0


def thumbnail(packed: dict[str, Any]) -> dict[str, Any]:
    """Lines of a diagram.

    Args:
        packed: What `pack` makes of a simulation.

    Returns:
        `lines`: for each other vehicle whether it is the target, and its distance ahead of the ego
        at `POINTS` instants [m], None where it is far or not there; `lane`: how far across the road
        the ego is from where it began [dm]; `stages`: each with its share of the time.
    """
    values = packed["values"]
    frames = np.linspace(0, values["num_frames"] - 1, POINTS).round().astype(int)
    ego = packed["vehicles"][0]
    own, across = (_column(ego, name, frames) for name in ("s", "d"))
    lines = [
        {"target": one["slot"] == values["target"], "ahead": _near(_column(one, "s", frames) - own)}
        for one in packed["vehicles"][1:]
    ]
    span = max(values["duration_s"], 1e-9)
    stages = [[one["stage"], one["from_s"] / span, one["to_s"] / span] for one in values["stages"]]
    return {
        "lines": [one for one in lines if any(at is not None for at in one["ahead"])],
        "lane": [round(float(at) * 10.0) for at in np.nan_to_num(across - across[0])],
        "stages": [[name, round(first, 3), round(last, 3)] for name, first, last in stages],
    }


def _column(vehicle: dict[str, Any], name: str, frames: np.ndarray) -> np.ndarray:
    """A position at some frames [m], NaN where the vehicle is not there."""
    column = np.cumsum(np.cumsum(vehicle[name])) / _MM
    at = frames - vehicle["first"]
    there = (at >= 0) & (at < len(column)) & ~np.isin(frames, vehicle["away"])
    return np.where(there, column[np.clip(at, 0, len(column) - 1)], np.nan)


def _near(ahead: np.ndarray) -> list[int | None]:
    return [round(float(at)) if abs(at) <= REACH_M else None for at in ahead]
