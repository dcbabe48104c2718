"""Friction of tyres by speed and film of water."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from overtaking.knowledge.toml_reader import read_record


@dataclass(frozen=True, slots=True, kw_only=True)
class FrictionTable:
    """Peak friction of car tyres, and how other tyres and deeper water differ.

    Attributes:
        speeds: Rows of the table [m/s], ascending.
        films_mm: Columns of the table [mm of water], ascending.
        new: Friction of a new tyre, (speed, film).
        worn: Friction of a tyre at the legal limit of wear, (speed, film).
        tread_new_mm: Tread depth that `new` stands for [mm].
        tread_worn_mm: Tread depth that `worn` stands for [mm].
        tread_default_mm: Tread depth of a vehicle of which nothing else is known [mm].
        truck_dry_factor: Friction of truck tyres over that of car tyres on a dry road.
        truck_film_mm: Film above which truck tyres lose less with speed [mm].
        truck_loss_factor: Part of the car tyre's speed-dependent loss that they then have.
        sliding_ratio: Friction of a locked wheel over the peak.
        floor: Smallest friction that the model uses.
        aquaplaning_friction: Friction below which a tyre counts as aquaplaning ...
        aquaplaning_film_mm: ... provided that the film is at least this [mm].
        usable_share: Part of the friction that a planner may count on.
    """

    speeds: tuple[float, ...]
    films_mm: tuple[float, ...]
    new: tuple[tuple[float, ...], ...]
    worn: tuple[tuple[float, ...], ...]
    tread_new_mm: float
    tread_worn_mm: float
    tread_default_mm: float
    truck_dry_factor: float
    truck_film_mm: float
    truck_loss_factor: float
    sliding_ratio: float
    floor: float
    aquaplaning_friction: float
    aquaplaning_film_mm: float
    usable_share: float


@cache
def friction_table() -> FrictionTable:
    """The friction of tyres; source `bosch-handbook`."""
    return read_record(FrictionTable, "friction.toml", "table")
