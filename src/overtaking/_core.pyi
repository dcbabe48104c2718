"""The compiled engine; its source is `crates/overtaking-py`. Use it through `sim.engine`."""

from typing import Any, Final, TypedDict

import numpy as np
from numpy.typing import NDArray

class _Road(TypedDict):
    """Lateral positions grow towards the fast side [m]."""

    num_lanes: int
    boundaries: list[float]  # 9
    film_path: list[float]  # 8
    side: float
    pose: list[float]  # x0, y0, heading, its cosine, its sine

class _Constants(TypedDict):
    """Numbers of the model; `values` in the order of `constant_fields`."""

    values: list[float]
    friction_new: list[list[float]]  # (speed, film)
    friction_worn: list[list[float]]
    friction_speeds: list[float]
    friction_films: list[float]

MAX_VEHICLES: Final[int]
MAX_PERCEPTS: Final[int]
LANES: Final[int]
VERSION: Final[str]

def simulate(
    *,
    vehicle: NDArray[np.floating[Any]],
    simulation: NDArray[np.floating[Any]],
    index: NDArray[np.uint64],
    slots: int,
    frames: int,
    seed: int,
    record_every: int,
    road: _Road,
    constants: _Constants,
    outputs: dict[str, NDArray[Any]],
    later: tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]], int] | None = None,
    level: str | None = None,
) -> None:
    """Simulate a batch and fill the flat arrays of `outputs`; ValueError for what does not fit."""

def vehicle_fields() -> list[str]:
    """Names of the vehicle parameters, in order."""

def simulation_fields() -> list[str]:
    """Names of the simulation parameters, in order."""

def constant_fields() -> list[str]:
    """Names of the constants, in order."""

def simd_levels() -> list[tuple[str, bool]]:
    """Every SIMD level that the engine has, and whether this CPU can run it."""

def simd_level() -> str:
    """The SIMD level that is used when none is asked for."""

def num_threads() -> int:
    """Threads of the pool that simulations are spread over."""
