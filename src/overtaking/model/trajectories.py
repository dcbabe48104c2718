"""Recorded states of a batch of simulations, as integers of fixed resolutions.

`Trajectories` is the result of a simulation or of reading a recording of real traffic. Signals,
events, verdicts, tables and films are computed from it. They all read the recorded integers, not
the floats of the simulation, so that labels from memory and from a file agree.

Terms:
    slot: number of a vehicle within its simulation; the ego, the vehicle under study, has 0.
    frame: a recorded instant, `Scenario.frame_interval_ms` apart. Axes of time have the length of
        the longest simulation of the batch; the ends of shorter ones are padding.
    decision: the ego driver's choice to change lanes, or to cancel a lane change.
    branch: a copy of a simulation in which interventions change the driver, a vehicle or the
        weather from some frame on; it answers a what-if question.
    percept: the ego driver's belief about a neighbour at a decision, beside the true values.
    step (of an integer): the amount that the integer 1 stands for, such as 1 mm.
    engines: the compiled one and a readable reference in Python, which record the same bits.
    world: the plane coordinates of OpenDRIVE, a format of road maps, with y to the left of x.

`FieldSpec` declares description, unit, range and table column of a field. `missing` is a value
outside the range that is valid, too, and null in tables. `null_unless` names the field without
which a column is null, after a dot if it is a field of the same class. `needs` names the properties
(`UNKNOWNS`) without which it is null. `with_field_docs` lists the fields in the docstring of the
class.
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
"""Slot that stands for no vehicle; a null in every table."""

UNKNOWNS = (
    "weather",  # Weather and light.
    "drivers",  # All of `DriverTraits`.
    "bodies",  # All of `VehicleSpecs` except length, width and kind.
    "kinds",  # Kinds of the vehicles, such as car or truck.
    "marks",  # Lines between the lanes.
    "speed_limit",
    "road_kind",  # Motorway, rural road or street.
    "indicators",  # Direction indicators.
    "lamps",  # All lights except the indicators.
    "wheel_angle",
    "yaw_rate",
    "impulse",  # Impulse and speed of approach of collisions.
    "stage",  # `Stage` of the ego.
    "percepts",  # All of `Percepts`.
)
"""Properties that a recording may leave unknown. Arrays then hold placeholders, tables hold nulls,
and rules of the law that need the property give the verdict "undecidable"."""

BEYOND_KERB_EDGE = 255
"""Lane index of a vehicle beyond the edge of the road on the kerb side."""

LANE_CHANGE_SPEED = 0.15
"""Lateral speed above which a vehicle changes lanes instead of wandering in its lane [m/s].

The search for overtakes in recordings uses it, and so does the derivation of `Stage` for egos that
the traffic simulator SUMO moves. A slow lane change peaks at 0.66 m/s, and vehicles that keep their
lane move more slowly than 0.15 m/s. Labels read this limit from `event_detection.toml`
(`least_speed`), rounded to float32; a test compares the two."""

POSITION_RESOLUTION = 1e-3  # [m]
SPEED_RESOLUTION = 1e-3  # [m/s]
ANGLE_RESOLUTION = 1e-4  # [rad]
ACCEL_RESOLUTION = 1e-3  # [m/s^2]

_MAX_POSITION_STEPS = 2.0e9
"""Positions are clipped to this many millimetres, 2,000 km, as in the engines. No valid road is
so long. The largest int32, 2**31 - 1, is no limit: as a float32 it is rounded up and overflows."""


class Stage(IntEnum):
    """Stage of the ego's overtake, as its driver intends it."""

    FOLLOW = 0  # No overtake: the ego drives freely or follows, and may wait for a gap.
    PULL_OUT = 1  # It changes to the lane on the overtaking side.
    PASS = 2  # It drives past the target.
    RETURN = 3  # It changes back ahead of the target.
    DONE = 4  # The overtake is completed.
    ABORT = 5  # It gives up and changes back behind the target.
    CRASHED = 6  # It has collided, left the road or spun, and no longer drives.


OVERTAKING_STAGES = (Stage.PULL_OUT, Stage.PASS, Stage.RETURN, Stage.ABORT)
"""The stages in which an overtake has begun and has not ended."""


class Lights(IntFlag):
    """Bits of the recorded `lights` of a vehicle."""

    INDICATOR_LEFT = 1
    INDICATOR_RIGHT = 2
    BRAKE = 4
    LOW_BEAM = 8
    HIGH_BEAM = 16
    REAR_FOG = 32


class ManoeuvreKind(IntEnum):
    """Decision of the ego's driver that a percept was recorded for."""

    PULL_OUT = 0  # Begin the lane change to overtake.
    RETURN = 1  # Begin the lane change back.
    CANCEL = 2  # Reverse either lane change: give up the overtake, or stay out and not return.


class PerceivedVehicle(IntEnum):
    """The neighbours at a decision, in the order of the last axis of `Percepts`."""

    LEADER = 0
    """The vehicle ahead in the ego's lane."""
    NEW_LEADER = 1
    """The vehicle ahead in the lane that the ego enters; in an opposing lane the oncoming one."""
    NEW_FOLLOWER = 2
    """The vehicle behind in the lane that the ego enters."""


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class States(Batch):
    """Recorded states, as integers; shape (simulation, vehicle, time).

    Where `Trajectories.state_mask` is False, they are undefined. `wheel_angle` is the angle of the
    steered front wheels. `lane` and `lights` declare no column, because tables compute columns of
    other forms from them.

    To add a state, add a field here, and its formula in `sim.reference.recorder` and in the file
    `recorder.rs` of the engine. The recorded arrays, the columns of tables and their documentation
    follow, in the order of the fields. The hashes of all simulations change.

    The ranges of speed and angles are chosen: 1000 m/s, to catch wrong units, and half a turn.
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
            "Front wheels, positive to the left",
            "0.1 mrad",
            -31_416,
            31_416,
            needs=["wheel_angle"],
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
            # The fast edge is on the overtaking side, the slow edge on the kerb side.
            "Lane index, 0 the slowest; `num_lanes` beyond the fast edge, 255 beyond the slow edge",
            "1",
            0,
            # Largest index: `num_lanes`, the entry "lane or beyond" of `Scenario.axis_lengths` less
            # one. 255 is valid, too; it is no null, as the field has no column of its own.
            AxisEnd("lane or beyond"),
            missing=BEYOND_KERB_EDGE,
            column=None,
        ),
    ]
    lights: Annotated[U8, FieldSpec("`Lights` bits", "1", 0, sum(Lights), column=None)]


STATE_DTYPES = {
    name: field.dtype.type
    for name, field in batch_fields(States).items()
    if field.dtype  # For type checkers: fields that are no arrays have no dtype, but here all are.
}
"""Integer type of each field of `States`, in their order."""

STATE_RESOLUTION = {
    name: 1.0 / units.INTEGER_UNITS[field.spec.unit][1]
    for name, field in batch_fields(States).items()
    if field.spec.unit in units.INTEGER_UNITS
}
"""Step of each field of `States` that has a unit [SI unit of the field]. For the unit "mm",
`INTEGER_UNITS` holds ("m", 1000): 1000 steps make 1 m."""

NOISY_STATES = frozenset({"accel_lon", "accel_lat", "yaw_rate"})
"""Fields of `States` that readers of recordings compute as derivatives of measured positions and
headings. Noise may exceed the range of their int16 (33 m/s^2, 3.3 rad/s), although no vehicle
reaches it. Such values are clipped. A value out of range in another field is an error."""


def largest_state(name: str) -> float:
    """Largest magnitude that a field of `States` can record.

    Args:
        name: The field, a key of `STATE_RESOLUTION`.

    Returns:
        The magnitude [SI unit of the field].
    """
    _, high = batch_fields(States)[name].spec.limits
    return min(float(np.iinfo(STATE_DTYPES[name]).max), high) * STATE_RESOLUTION[name]


def to_integers(name: str, steps: NDArray[np.float64], where: str) -> NDArray[Any]:
    """The recorded integers of a field of `States`, rounded half to even as in the engines.

    The integer type alone limits the values here. `model.checks` and the readers of recordings
    compare them with the declared range, which is narrower for speed and angles.

    Args:
        name: The field, a key of `STATE_RESOLUTION`.
        steps: Its values divided by its resolution, any shape; in `NOISY_STATES` without NaN.
        where: Name of the recording or simulation, for the message.

    Returns:
        Integers of the type in `STATE_DTYPES`, same shape.

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
"""Declaration of a property of the first collision of a vehicle."""


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
    # Without `needs`: a recording without impulses may still state the time.
    time: Annotated[
        I32, _contact("Instant of that contact", "ms", 0, MAX_DURATION * 1000, needs=())
    ]
    impulse: Annotated[I32, _contact("Impulse of that contact", "N s", 0, 2**31 - 1)]
    closing_speed: Annotated[I32, _contact("Speed of approach along the contact normal", "mm/s")]


# Declarations of the fields of `Percepts`: of the decision, of a neighbour as the driver perceives
# it, and of the same neighbour as it is.
_decision = partial(FieldSpec, axes=("simulation", "decision"))
_belief = partial(FieldSpec, null_unless=".is_detected")
_truth = partial(FieldSpec, null_unless=".slot")


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class Percepts(Batch):
    """Beliefs of the ego's driver, beside the truth, at each decision to change lanes or to cancel.

    Arrays that describe the decision have shape (simulation, decision); arrays that describe the
    neighbours have a third axis, `PerceivedVehicle`. Rows are in the order of time; rows after the
    last decision have `valid` False. Without a neighbour in a role, its slot is `NO_VEHICLE`.
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
        """Percepts without any recorded decision.

        Args:
            num_simulations: Number of simulations.
            num_rows: Length of the axis of decisions: 0 for a recording without percepts, more if
                the caller fills in decisions later.
        """
        decisions = (num_simulations, num_rows)
        neighbours = (*decisions, len(PerceivedVehicle))
        return cls(
            valid=np.zeros(decisions, bool),
            kind=np.zeros(decisions, np.uint8),
            time=np.zeros(decisions, np.int32),
            slot=np.full(neighbours, NO_VEHICLE),
            is_detected=np.zeros(neighbours, bool),
            gap=np.zeros(neighbours, np.int32),
            closing_speed=np.zeros(neighbours, np.int32),
            true_gap=np.zeros(neighbours, np.int32),
            true_closing_speed=np.zeros(neighbours, np.int32),
        )


def rotate_headings(road: Road, states: States, sign: float) -> NDArray[np.int16]:
    """Headings of all states with the direction of the road at their stations added or subtracted.

    Args:
        road: The road.
        states: States, of which stations and headings are read.
        sign: +1 to get headings in the world from angles to the road; -1 for the inverse.

    Returns:
        Headings from -pi to pi, shape (simulation, vehicle, time) [0.1 mrad].
    """
    headings = np.empty_like(states.heading)
    for row, s in enumerate(states.s):  # Row by row, to hold float64 for one simulation at a time.
        direction = road.heading_at(s * POSITION_RESOLUTION)
        angle = states.heading[row] * ANGLE_RESOLUTION + sign * direction
        angle = angle - math.tau * np.rint(angle / math.tau)
        headings[row] = np.rint(angle / ANGLE_RESOLUTION)
    return headings


def with_world_coordinates(road: Road, states: States, is_present: NDArray[np.bool_]) -> States:
    """The states with world coordinates, also on a curved road.

    The engines record world positions and headings for straight roads only. On a curved road their
    `x` and `y` have no meaning, and their `heading` is the angle to the road. This function
    computes all three from the recorded integers, in float64 and a fixed order of operations, so
    that the compiled and the reference engine give the same bits.

    Args:
        road: The road.
        states: States as an engine records them.
        is_present: Whether a state belongs to a vehicle, shape (simulation, vehicle, time).

    Returns:
        The states with world coordinates, 0 where `is_present` is False; on a straight road the
        argument itself.
    """
    if not road.is_curved:
        return states
    x, y = np.zeros_like(states.s), np.zeros_like(states.s)
    # One simulation at a time, because its points fit into the processor's caches.
    for row, mask in enumerate(is_present):
        s, d = (values[row][mask] * POSITION_RESOLUTION for values in (states.s, states.d))
        for coordinate, metres in zip((x, y), road.to_world(s, d), strict=True):
            coordinate[row][mask] = np.rint(metres / POSITION_RESOLUTION).clip(
                -_MAX_POSITION_STEPS, _MAX_POSITION_STEPS
            )
    heading = np.where(is_present, rotate_headings(road, states, 1.0), np.int16(0))
    return dataclasses.replace(states, x=x, y=y, heading=heading)


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectories(IdentityBatch):
    """A batch of recorded simulations with everything needed to label them.

    A recording of real traffic is stored as if it had been simulated, a simulation per overtake.
    As an `IdentityBatch` it equals only itself under `==`; `equals` compares the content.

    Attributes:
        scenario: The simulated scenarios, with road, vehicles, drivers and weather.
        num_frames: Number of recorded frames of each simulation, shape (simulation,).
        states: States of all vehicles, padded to the longest simulation of the batch.
        stage: `Stage` of the ego, shape (simulation, time).
        collided_with: Slot of the first vehicle that the ego has collided with, `NO_VEHICLE` before
            the collision, shape (simulation, time).
        contacts: First collision of each vehicle.
        percepts: Beliefs of the ego's driver at its decisions.
        trace_hash: 128-bit hash over the recorded integers, as 32-bit words, shape (simulation, 4).
            Equal simulations have equal hashes on every machine.
        unknown: Properties that the recording does not state, names in `UNKNOWNS`; their values
            are placeholders. Empty for simulations of this package.
        is_recorded: Whether a vehicle was recorded in a frame, shape (simulation, vehicle, time);
            None if every vehicle was recorded from the first frame to the last.
        is_kind_known: Whether the kind of each vehicle is known, shape (simulation, vehicle); None
            if all kinds are known, or if no kind is, because "kinds" is in `unknown`.
        actions: Actions of a user's own driver; None if the model driver drove the ego.
        branch_origin: Scenarios from which branches were made, and their interventions; None for
            simulations that are no branches.
        import_findings: Rows of `import_report`. `equals` and `trace_hash` ignore them, because
            they describe the source and not the traffic.
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
        """Find the overtakes in a table of vehicle states with any columns, units and rate.

        Args:
            table: One row per vehicle and instant: a pandas or Arrow table, or a mapping from
                column names to columns.
            options: The keywords `columns`, `road`, `driving_side`, `speed_limit`, `attempts_only`,
                `vehicles` and `strict` of `overtaking.api.file_formats.trajectories_from_table`.

        Raises:
            ConfigError: The map of columns or the road cannot be used.
            ImportFormatError: The table cannot be used; the message names row and column.
        """
        # Imported at the call: this module is below the readers of files and must not load them.
        return import_module("overtaking.api.file_formats").trajectories_from_table(
            table, **options
        )

    def to_pandas(self, row: int = 0) -> Any:
        """The states of one simulation in SI units, as a pandas DataFrame.

        Args:
            row: Position of the simulation in the batch, from 0.

        Returns:
            One row per vehicle and frame, with the columns of the table `states` of a data set.

        Raises:
            NoSuchSimulationError: The batch has no such row.
        """
        # Imported at the call, because `overtaking.model` loads no table library.
        return import_module("overtaking.data.tables.data_frames").states_frame(self, row)

    @property
    def import_report(self) -> Any:
        """Faults that the import found in the recordings: a pandas DataFrame, one row each.

        Columns: `recording`, `check`, `vehicle` (text; missing for the whole file), `first_time_s`
        (in the time of the file; NaN for the whole file), `rows` (number of rows concerned),
        `consequence` ("corrected", "left out" or "reported") and `detail`. Empty for simulations of
        this package.
        """
        # Imported at the call, because `overtaking.model` loads no table library.
        return import_module("overtaking.data.import_report").report_frame(self.import_findings)

    @property
    def headings_and_origin(self) -> tuple[NDArray[np.int16], float]:
        """Headings and a direction; their difference is the angle from the road to each vehicle.

        A straight road has one direction, so the recorded integers stay as they are, and a caller
        needs no copy of them.

        Returns:
            Headings, shape (simulation, vehicle, time) [0.1 mrad], which a caller multiplies by
            `ANGLE_RESOLUTION`, and the direction to subtract then [rad]: on a straight road the
            recorded headings and the direction of the road, on a curved road the angles to the road
            and 0. The difference is not reduced to half a turn.
        """
        if not self.road.is_curved:
            return self.states.heading, self.road.heading
        return rotate_headings(self.road, self.states, -1.0), 0.0

    def summary(self) -> Mapping[str, object]:
        """Origin and size of the batch, frames and their interval [ms], for its representation."""
        frames = {"frames": self.stage.shape[1], "ms": self.scenario.frame_interval_ms}
        return {**self.scenario.summary(), **frames}

    def constraints(self) -> Iterable[Constraint]:
        """Conditions for `model.checks`: each simulation has frames, `unknown` has valid names."""
        frames = self.num_frames
        is_invalid = (frames < 1) | (frames > self.stage.shape[1])
        expected = f"1 to {self.stage.shape[1]}, as stage has"
        yield Constraint("num_frames", expected, is_invalid, frames)
        invalid_names = sorted(self.unknown - set(UNKNOWNS))
        expected = f"names among {', '.join(UNKNOWNS)}"
        # A mask of shape () is about the batch as a whole; the message shows the first wrong name.
        yield Constraint(
            "unknown", expected, np.array(bool(invalid_names)), np.array(invalid_names)
        )

    @property
    def state_mask(self) -> NDArray[np.bool_]:
        """Whether a vehicle has a recorded state in a frame, shape (simulation, vehicle, time)."""
        has_vehicle = self.scenario.vehicles.valid[:, :, None] & self.frame_mask[:, None, :]
        return has_vehicle if self.is_recorded is None else has_vehicle & self.is_recorded

    @property
    def known_kinds(self) -> Mask:
        """Whether the kind of each vehicle is known, shape (simulation, vehicle)."""
        valid = self.scenario.vehicles.valid
        if "kinds" in self.unknown:
            return np.zeros_like(valid)
        return np.ones_like(valid) if self.is_kind_known is None else self.is_kind_known

    @property
    def is_excerpt(self) -> bool:
        """Whether the traffic began before the first frame, as in recordings of real traffic.

        The stage of the ego decides: simulators record it, recordings of real traffic lack it.
        """
        return "stage" in self.unknown

    @property
    def road(self) -> Road:
        """The road of the batch."""
        return self.scenario.road

    @property
    def frame_mask(self) -> NDArray[np.bool_]:
        """Whether a frame is not padding of a shorter simulation, shape (simulation, time)."""
        return np.arange(self.stage.shape[1])[None, :] < self.num_frames[:, None]

    @property
    def time_ms(self) -> I32:
        """Time of each frame since the start, shape (time,) [ms]."""
        return np.arange(self.stage.shape[1], dtype=np.int32) * np.int32(
            self.scenario.frame_interval_ms
        )
