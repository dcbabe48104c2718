"""Recorded states of a batch of simulations, as integers of fixed resolutions.

All later code reads these integers, so that labels from memory and from a file agree.
"""

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum, IntFlag
from functools import partial
from importlib import import_module
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core import units
from overtaking.core.arrays import I16, I32, U8, U32, Mask
from overtaking.core.errors import SchemaError
from overtaking.model.batch import (
    AxisEnd,
    Batch,
    ColumnName,
    Constraint,
    FieldSpec,
    IdentityBatch,
    batch_fields,
    with_field_docs,
)
from overtaking.model.driver_interface import Actions
from overtaking.model.import_report import ImportFinding
from overtaking.model.road import Road
from overtaking.model.scenario import MAX_DURATION, BranchOrigin, Scenario

NO_VEHICLE = np.uint8(255)
"""Slot number where there is no vehicle to name; a null in every table."""

UNKNOWNS = (
    "weather",  # Weather and light.
    "drivers",  # Everything in `DriverTraits`.
    "bodies",  # All of `VehicleSpecs` except length, width and kind.
    "kinds",  # Types of the vehicles.
    "marks",  # Lines between the lanes.
    "speed_limit",
    "road_kind",
    "indicators",
    "lamps",
    "wheel_angle",
    "yaw_rate",
    "impulse",
    "stage",
    "percepts",
)
"""Properties that a recording may leave open. Rules that need them are then undecidable."""

BEYOND_KERB_EDGE = 255
"""Lane index of a vehicle beyond the edge of the road on the kerb side."""

LANE_CHANGE_SPEED = 0.15
"""Lateral speed from which a vehicle changes lanes instead of keeping its lane [m/s].

Candidates in recordings and the stages of SUMO's drivers use it; labels read the same number from
`event_detection.toml`, because their float32 arithmetic is part of recorded results."""

POSITION_RESOLUTION = 1e-3
_MAX_RECORDED = 2.0e9  # Steps that fit into the recorded integers, as the step clamps them.
SPEED_RESOLUTION = 1e-3
ANGLE_RESOLUTION = 1e-4
ACCEL_RESOLUTION = 1e-3


class Stage(IntEnum):
    """Stage of the ego's overtake, the state of its state machine."""

    FOLLOW = 0
    PULL_OUT = 1
    PASS = 2
    RETURN = 3
    DONE = 4
    ABORT = 5
    CRASHED = 6


OVERTAKING_STAGES = (Stage.PULL_OUT, Stage.PASS, Stage.RETURN, Stage.ABORT)
"""The stages of an overtake that has begun and not ended."""


class Lights(IntFlag):
    """Bits of the recorded `lights` of a vehicle."""

    INDICATOR_LEFT = 1
    INDICATOR_RIGHT = 2
    BRAKE = 4
    LOW_BEAM = 8
    HIGH_BEAM = 16
    REAR_FOG = 32


class ManoeuvreKind(IntEnum):
    """Kind of the decision that a percept was recorded for."""

    PULL_OUT = 0
    RETURN = 1
    CANCEL = 2


class PerceivedVehicle(IntEnum):
    """The vehicles that a percept is about, the order of its last axis."""

    LEADER = 0
    """The vehicle ahead in the ego's lane."""
    NEW_LEADER = 1
    """The vehicle ahead in the lane that the ego enters."""
    NEW_FOLLOWER = 2
    """The vehicle behind in the lane that the ego enters."""


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class States(Batch):
    """Recorded states; shape (simulation, vehicle, time), the frames of one vehicle adjacent.

    A new state is a field here and a formula in `sim.reference.recording` and in `words.rs`.
    Memory, hash, tables and pages follow, in the order of the fields.
    """

    AXES = ("simulation", "vehicle", "time")

    x: Annotated[I32, FieldSpec("OpenDRIVE x of the bounding-box centre", "mm")]
    y: Annotated[I32, FieldSpec("OpenDRIVE y of the bounding-box centre, right-handed", "mm")]
    s: Annotated[I32, FieldSpec("Position along the road", "mm")]
    d: Annotated[I32, FieldSpec("Position across the road, positive to the left", "mm")]
    speed: Annotated[I32, FieldSpec("Speed, never negative", "mm/s", 0, 1_000_000)]
    heading: Annotated[
        I16, FieldSpec("Heading, anticlockwise from world x", "0.1 mrad", -31_416, 31_416)
    ]
    wheel_angle: Annotated[
        I16,
        FieldSpec(
            "Front wheels, positive to the left", "0.1 mrad", -31_416, 31_416, needs=["wheel_angle"]
        ),
    ]
    accel_lon: Annotated[I16, FieldSpec("Acceleration forwards, contacts excluded", "mm/s^2")]
    accel_lat: Annotated[I16, FieldSpec("Acceleration to the left", "mm/s^2")]
    yaw_rate: Annotated[
        I16, FieldSpec("Turning rate, anticlockwise", "0.1 mrad/s", needs=["yaw_rate"])
    ]
    lane: Annotated[
        U8,
        FieldSpec(
            "Lane index, 0 the slowest; `num_lanes` beyond the fast edge, 255 beyond the slow edge",
            "1",
            0,
            AxisEnd("lane or beyond"),
            missing=BEYOND_KERB_EDGE,
            column=None,
        ),
    ]
    lights: Annotated[U8, FieldSpec("`Lights` bits", "1", 0, sum(Lights), column=None)]


STATE_DTYPES = {
    name: field.dtype.type for name, field in batch_fields(States).items() if field.dtype
}
"""Type of the numbers of each field of `States`, in their order."""

STATE_RESOLUTION = {
    name: 1.0 / units.INTEGER_UNITS[field.spec.unit][1]
    for name, field in batch_fields(States).items()
    if field.spec.unit in units.INTEGER_UNITS
}
"""Size of a step of each number in `States` [SI units]."""

NOISY_STATES = frozenset({"accel_lon", "accel_lat", "yaw_rate"})
"""Quantities that are differentiated from measured ones. Their noise in a recording may exceed the
range of the recorded integers, although no vehicle reaches it; such values are clipped."""


def largest_state(name: str) -> float:
    """Largest magnitude of a field of `States`, one of `STATE_RESOLUTION` [SI units]."""
    _, high = batch_fields(States)[name].spec.limits
    return min(float(np.iinfo(STATE_DTYPES[name]).max), high) * STATE_RESOLUTION[name]


def to_integers(name: str, steps: NDArray[np.float64], where: str) -> NDArray[Any]:
    """The recorded integers of a field of `States`, rounded half to even.

    Args:
        name: The field, one of `STATE_RESOLUTION`.
        steps: Its values divided by the size of a step, any shape [steps].
        where: Name of the recording or simulation, for the message.

    Raises:
        SchemaError: A value is too large for the integers or NaN, in a field that is not among
            `NOISY_STATES`.
    """
    dtype = STATE_DTYPES[name]
    steps = np.rint(steps)
    if name in NOISY_STATES:
        largest = np.iinfo(dtype).max
        return np.clip(steps, -largest, largest).astype(dtype)
    is_in_range = np.abs(steps) <= np.iinfo(dtype).max  # Also false for NaN.
    if not is_in_range.all():
        raise SchemaError(
            what=name,
            where=where,
            expected=f"at most {largest_state(name):g} in SI units",
            got=f"{float(steps[~is_in_range].flat[0]) * STATE_RESOLUTION[name]:g}",
            next_step="shift the coordinates, or correct their unit",
        )
    return steps.astype(dtype)


BYTES_PER_STATE = sum(np.dtype(kind).itemsize for kind in STATE_DTYPES.values())
"""Size of the recorded state of one vehicle in one frame [bytes]."""


_contact = partial(
    FieldSpec, column=ColumnName(prefix="contact_"), null_unless=".partner", needs=["impulse"]
)


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class Contacts(Batch):
    """First collision of each vehicle; shape (simulation, vehicle).

    A vehicle without a collision has the partner `NO_VEHICLE`.
    """

    AXES = ("simulation", "vehicle")

    partner: Annotated[
        U8,
        FieldSpec(
            "Slot it first collided with",
            "1",
            0,
            AxisEnd("vehicle"),
            missing=int(NO_VEHICLE),
            column=ColumnName("vehicle", "contact_"),
        ),
    ]
    time: Annotated[
        I32, _contact("Instant of that contact", "ms", 0, MAX_DURATION * 1000, needs=())
    ]
    impulse: Annotated[I32, _contact("Impulse of that contact", "N s", 0, 2**31 - 1)]
    closing_speed: Annotated[I32, _contact("Speed of approach along the contact normal", "mm/s")]


_decision = partial(FieldSpec, axes=("simulation", "decision"))
_belief = partial(FieldSpec, null_unless=".is_detected")
_truth = partial(FieldSpec, null_unless=".slot")


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class Percepts(Batch):
    """Beliefs of the ego's driver at each decision.

    Arrays have shape (simulation, decision), or a last axis of the vehicles in `PerceivedVehicle`.
    Without a neighbour its slot is `NO_VEHICLE`.
    """

    AXES = ("simulation", "decision", len(PerceivedVehicle))

    valid: Annotated[Mask, _decision("Whether the row holds a decision", column=None)]
    kind: Annotated[
        U8,
        _decision(
            "Kind of the decision",
            "1",
            0,
            max(ManoeuvreKind),
            names=[kind.name for kind in ManoeuvreKind],
        ),
    ]
    time: Annotated[I32, _decision("Instant of the decision", "ms", 0, MAX_DURATION * 1000)]
    slot: Annotated[
        U8,
        FieldSpec(
            "Slot of the true neighbour",
            "1",
            0,
            AxisEnd("vehicle"),
            missing=int(NO_VEHICLE),
            column=ColumnName("vehicle"),
        ),
    ]
    is_detected: Annotated[Mask, FieldSpec("Whether the ego had noticed it")]
    gap: Annotated[I32, _belief("Bumper gap as the ego believed it, null unless detected", "mm")]
    closing_speed: Annotated[
        I32, _belief("Speed of approach as the ego believed it, null unless detected", "mm/s")
    ]
    true_gap: Annotated[I32, _truth("Bumper gap as it was", "mm")]
    true_closing_speed: Annotated[I32, _truth("Speed of approach as it was", "mm/s")]

    @classmethod
    def empty(cls, num_simulations: int, num_rows: int) -> "Percepts":
        """Rows without a recorded decision."""
        pair = (num_simulations, num_rows)
        triple = (*pair, len(PerceivedVehicle))
        return cls(
            valid=np.zeros(pair, bool),
            kind=np.zeros(pair, np.uint8),
            time=np.zeros(pair, np.int32),
            slot=np.full(triple, NO_VEHICLE),
            is_detected=np.zeros(triple, bool),
            gap=np.zeros(triple, np.int32),
            closing_speed=np.zeros(triple, np.int32),
            true_gap=np.zeros(triple, np.int32),
            true_closing_speed=np.zeros(triple, np.int32),
        )


def rotate_headings(road: Road, states: States, sign: float) -> NDArray[np.int16]:
    """Headings with the direction of the road added or subtracted, same shape [0.1 mrad].

    Args:
        road: The road.
        states: Stations and headings.
        sign: +1 to add it, -1 to subtract it.
    """
    headings = np.empty_like(states.heading)
    for row, s in enumerate(states.s):
        direction = road.heading_at(s * POSITION_RESOLUTION)
        angle = states.heading[row] * ANGLE_RESOLUTION + sign * direction
        angle = angle - math.tau * np.rint(angle / math.tau)
        headings[row] = np.rint(angle / ANGLE_RESOLUTION)
    return headings


def with_world_coordinates(road: Road, states: States, is_present: NDArray[np.bool_]) -> States:
    """The same states with world positions and headings, on a road with bends.

    Positions follow from the recorded millimetres by float64 arithmetic in a fixed order, so that
    both engines give the same bits.

    Args:
        road: The road.
        states: Recorded states, with headings relative to the road.
        is_present: Which states belong to a vehicle, same shape.
    """
    if not road.is_curved:
        return states
    x, y = np.zeros_like(states.s), np.zeros_like(states.s)
    # One simulation at a time: its points fit into the caches, the points of a batch do not.
    for row, mask in enumerate(is_present):
        s, d = (values[row][mask] * POSITION_RESOLUTION for values in (states.s, states.d))
        for coordinate, metres in zip((x, y), road.to_world(s, d), strict=True):
            coordinate[row][mask] = np.rint(metres / POSITION_RESOLUTION).clip(
                -_MAX_RECORDED, _MAX_RECORDED
            )
    heading = np.where(is_present, rotate_headings(road, states, 1.0), np.int16(0))
    return dataclasses.replace(states, x=x, y=y, heading=heading)


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectories(IdentityBatch):
    """A batch of recorded simulations with everything needed to label them.

    Attributes:
        scenario: The simulated scenarios.
        num_frames: Recorded frames of each simulation, shape (simulation,).
        states: Padded to the longest simulation of the batch.
        stage: `Stage` of the ego, (simulation, time).
        collided_with: Slot that the ego has collided with so far, `NO_VEHICLE` before,
            (simulation, time).
        contacts: First collision of each vehicle.
        percepts: Beliefs of the ego's driver at its decisions.
        trace_hash: 128-bit hash over the recorded integers, (simulation, 4) words.
        unknown: Properties that the recording does not state, names of `UNKNOWNS`; their values
            are placeholders. Empty for simulations of this package.
        is_recorded: Which vehicles were recorded in which frame, (simulation, vehicle, time); None
            where every vehicle was recorded from the first frame to the last.
        is_kind_known: Whether the kind of each vehicle is known, (simulation, vehicle); None if all
            kinds are known, or none of them because "kinds" is among `unknown`.
        actions: Actions of a driver of the user's; None where the model driver drove the ego.
        branch_origin: Origin and interventions of branches; None for other simulations.
        import_findings: Rows of `import_report`. They describe the source, so comparisons and
            hashes ignore them.
    """

    scenario: Scenario
    num_frames: Annotated[I32, FieldSpec("Number of recorded frames")]
    states: States
    stage: Annotated[
        U8,
        FieldSpec(
            "Stage of the overtake, as the ego's driver sees it",
            "1",
            0,
            max(Stage),
            axes=("simulation", "time"),
            needs=["stage"],
            names=[stage.name for stage in Stage],
        ),
    ]
    collided_with: Annotated[
        U8,
        FieldSpec(
            "Slot that the ego has collided with so far",
            "1",
            0,
            AxisEnd("vehicle"),
            missing=int(NO_VEHICLE),
            axes=("simulation", "time"),
        ),
    ]
    contacts: Contacts
    percepts: Percepts
    trace_hash: Annotated[U32, FieldSpec(axes=("simulation", 4))]
    unknown: frozenset[str] = frozenset()
    is_recorded: Annotated[Mask | None, FieldSpec(axes=States.AXES)] = None
    is_kind_known: Annotated[Mask | None, FieldSpec(axes=("simulation", "vehicle"))] = None
    actions: Actions | None = None
    branch_origin: BranchOrigin | None = None
    import_findings: tuple[ImportFinding, ...] = field(default=(), compare=False)

    @classmethod
    def from_table(cls, table: Any, **options: Any) -> "Trajectories":
        """The overtakes in a table of states, of any columns, units and rate.

        The arguments `columns`, `road`, `driving_side`, `speed_limit`, `attempts_only`, `vehicles`
        and `strict` are those of `overtaking.api.file_formats.trajectories_from_table`.

        Args:
            table: A row per vehicle and instant: a pandas or Arrow table, or a mapping of columns.
            options: The other arguments.

        Raises:
            ConfigError: The map of columns or the road cannot be used.
            ImportFormatError: The table cannot be used; the message names row and column.
        """
        # By name, as the root does: a noun imports no reader (docs/adr/0040).
        return import_module("overtaking.api.file_formats").trajectories_from_table(
            table, **options
        )

    def to_pandas(self, row: int = 0) -> Any:
        """The states of one simulation in SI units: a pandas DataFrame.

        Args:
            row: Position of the simulation in the batch, from 0.

        Returns:
            One row per vehicle and frame, with the columns of the table `states` of a data set.

        Raises:
            NoSuchSimulationError: The batch has no such row.
        """
        # By name, because this package loads no table library.
        return import_module("overtaking.data.tables.data_frames").states_frame(self, row)

    @property
    def import_report(self) -> Any:
        """The findings of the examination of the recordings: a pandas DataFrame, one row each.

        Columns: `recording`, `check`, `vehicle` (text; missing for the whole file), `first_time_s`
        (as the file counts; NaN for the whole file), `rows`, `consequence` ("corrected", "left out"
        or "reported") and `detail`. Empty for simulations of this package.
        """
        # By name, because this package loads no table library.
        return import_module("overtaking.data.import_report").report_frame(self.import_findings)

    @property
    def headings_and_origin(self) -> tuple[NDArray[np.int16], float]:
        """Recorded headings, and the direction that they are measured from [0.1 mrad, rad].

        The angle to the road is the difference of both: on a straight road they are the heading as
        it is and the direction of the road, on one that bends the angle itself and 0.
        """
        if not self.road.is_curved:
            return self.states.heading, self.road.heading
        return rotate_headings(self.road, self.states, -1.0), 0.0

    def summary(self) -> Mapping[str, object]:
        """The summary of the scenario, with the number of frames and their interval [ms]."""
        frames = {"frames": self.stage.shape[1], "ms": self.scenario.frame_interval_ms}
        return {**self.scenario.summary(), **frames}

    def constraints(self) -> Iterable[Constraint]:
        """Each simulation has a frame or more, and `unknown` has known names."""
        frames = self.num_frames
        is_invalid = (frames < 1) | (frames > self.stage.shape[1])
        expected = f"1 to {self.stage.shape[1]}, as stage has"
        yield Constraint("num_frames", expected, is_invalid, frames)
        invalid_names = sorted(self.unknown - set(UNKNOWNS))
        expected = f"names among {', '.join(UNKNOWNS)}"
        yield Constraint(
            "unknown", expected, np.array(bool(invalid_names)), np.array(invalid_names)
        )

    @property
    def state_mask(self) -> NDArray[np.bool_]:
        """Whether a vehicle has a recorded state in a frame, shape (simulation, vehicle, time)."""
        rows = self.scenario.vehicles.valid[:, :, None] & self.frame_mask[:, None, :]
        return rows if self.is_recorded is None else rows & self.is_recorded

    @property
    def known_kinds(self) -> Mask:
        """Whether the kind of each vehicle is known, shape (simulation, vehicle)."""
        valid = self.scenario.vehicles.valid
        if "kinds" in self.unknown:
            return np.zeros_like(valid)
        return np.ones_like(valid) if self.is_kind_known is None else self.is_kind_known

    @property
    def is_excerpt(self) -> bool:
        """Whether the traffic had been going on before the first frame, as in recordings."""
        return "stage" in self.unknown

    @property
    def road(self) -> Road:
        """The road of the batch."""
        return self.scenario.road

    @property
    def frame_mask(self) -> NDArray[np.bool_]:
        """Which frames were recorded, shape (simulation, time)."""
        return np.arange(self.stage.shape[1])[None, :] < self.num_frames[:, None]

    @property
    def time_ms(self) -> I32:
        """Time of each frame since the start, shape (time,) [ms]."""
        return np.arange(self.stage.shape[1], dtype=np.int32) * np.int32(
            self.scenario.frame_interval_ms
        )
