"""Groups of simulations of a data set, and the facts about their roads, vehicles and events.

A fact is declared at the function that measures it: predicate, meaning, types of the arguments.
Files list facts in the order of these declarations. A measurement returns one column of integers
for each argument; a constant is its position among the constants of its type.

In facts, left is the overtaking side and lanes count from the slow side, in left-hand traffic too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.logic.vocabulary import (
    CLASS,
    EVENT,
    EVENT_NAMES,
    FRAME,
    KIND,
    LANE,
    MARK,
    MILLISECONDS,
    MM,
    OUTCOME,
    PERCENT,
    POLICY,
    ROAD,
    ROLE,
    SIDE,
    SIDES,
    SIMULATION,
    SIZE,
    SPEED,
    UNKNOWN,
    VEHICLE,
    ZONE_KIND,
    ArgumentType,
    Predicate,
    nearest_mm,
    rounded_down_mm,
    rounded_up_mm,
)
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.snapshots import (
    indicator_to_kerb_side,
    indicator_to_overtaking_side,
    is_oncoming,
    other_vehicles_at,
)
from overtaking.model.overtake_events import NEVER
from overtaking.model.road import DrivingSide
from overtaking.model.road_course import MAX_LENGTH
from overtaking.model.trajectories import NO_VEHICLE, POSITION_RESOLUTION
from overtaking.model.vehicles import EGO_SLOT
from overtaking.world.sight_distance import all_zones_for

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from overtaking.core.arrays import F32, I64, IndexArray, Mask
    from overtaking.data.load import Dataset
    from overtaking.model.ego_signals import EgoSignals
    from overtaking.model.road import Lane, Road, RoadMark
    from overtaking.model.trajectories import States, Trajectories
    from overtaking.model.verdicts import Case

GROUP_SIZE = 64
"""Simulations whose facts are in memory at the same time, as columns and as text."""

REACH_MM = 200_000
"""Facts give no positions of vehicles farther than this from the ego [mm]."""

ONCOMING_REACH_MM = 1_000_000
"""The same limit for oncoming vehicles, which close at twice the speed and are judged earlier."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationGroup:
    """Some simulations of a data set.

    Attributes:
        simulation_ids: Their numbers in the data set, shape (simulation,).
        case: Their trajectories with signals and events.
        classes: `OvertakeClass`, shape (simulation, policy); None without labels.
        outcome: `Outcome`, shape (simulation,); None without labels.
        num_read: Simulations of the data set up to the last of this group, those that were not
            asked for included; for progress.
    """

    simulation_ids: I64
    case: Case
    classes: NDArray[np.integer] | None = None
    outcome: NDArray[np.integer] | None = None
    num_read: int = 0

    def select(self, rows: NDArray[Any]) -> SimulationGroup:
        """Some of the simulations, by a mask or by their rows."""
        return replace(
            self,
            simulation_ids=self.simulation_ids[rows],
            case=self.case.select(rows),
            classes=None if self.classes is None else self.classes[rows],
            outcome=None if self.outcome is None else self.outcome[rows],
        )


def read_groups(
    dataset: Dataset, simulation_ids: I64 | None = None, size: int = GROUP_SIZE
) -> Iterator[SimulationGroup]:
    """Read simulations in order, one group after the other.

    Args:
        dataset: The data set. Trajectories that it does not keep are simulated again.
        simulation_ids: Their numbers in order; None for all.
        size: Largest number of simulations in a group.

    Raises:
        DatasetError: A file is damaged, or the simulator has changed.
    """
    for batch_ids, trajectories in dataset.batches(simulation_ids):
        classes, outcome = _read_labels(dataset, batch_ids)
        for begin in range(0, len(batch_ids), size):
            rows = np.arange(begin, min(begin + size, len(batch_ids)))
            yield SimulationGroup(
                simulation_ids=batch_ids[rows],
                case=case_from_trajectories(trajectories.select(rows)),
                classes=classes[rows],
                outcome=outcome[rows],
                num_read=int(batch_ids[rows[-1]]) + 1,
            )


def _read_labels(dataset: Dataset, simulation_ids: I64) -> tuple[I64, I64]:
    """Codes of the classes, shape (simulation, policy), and of the outcomes, shape (simulation,).

    The simulations are of one file, in order. The file has a row for each simulation and policy,
    with the policies of a simulation next to each other and in the order of `POLICY`.
    """
    first_id, num_policies = int(simulation_ids[0]), len(POLICY.constants)
    rows = dataset.rows("labels", first_id, int(simulation_ids[-1]))
    class_codes = [CLASS.constants.index(name.lower()) for name in rows["class"].to_pylist()]
    classes = np.array(class_codes).reshape(-1, num_policies)
    names = rows["outcome"].to_pylist()[::num_policies]
    outcome = np.array([OUTCOME.constants.index(name) for name in names])
    return classes[simulation_ids - first_id], outcome[simulation_ids - first_id]


FactColumns = tuple[NDArray[np.integer], ...]
"""A column for each argument of one predicate, with a row for each fact; constants as codes."""


def no_facts(num_arguments: int) -> FactColumns:
    """Columns without rows."""
    return (np.zeros(0, np.int64),) * num_arguments


def concatenate_facts(parts: Sequence[FactColumns], num_arguments: int) -> FactColumns:
    """The facts of several parts, which may be empty."""
    if not parts:
        return no_facts(num_arguments)
    return tuple(np.concatenate(columns) for columns in zip(*parts, strict=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class ApproachingVehicles:
    """Vehicles that approach the ego from ahead in the opposite direction; shape (encounter,).

    Attributes:
        simulation: Row of the simulation.
        frame: The frame.
        slot: Slot of the vehicle.
        gap: Distance between the front bumpers [m].
    """

    simulation: IndexArray
    frame: IndexArray
    slot: IndexArray
    gap: F32


@dataclass(frozen=True, eq=False, kw_only=True)
class FactSource:
    """The recordings that facts are measured in.

    Attributes:
        group: The simulations.
        frame_step: Interval between the frames with positions [frames]. Frames in which lanes,
            order or events change have positions too.
        roles: Constants of `ROLE` for which `spacing` and `forced_braking` are measured: these
            facts exist for every frame, so roles that no rule reads are left out.
    """

    group: SimulationGroup
    frame_step: int
    roles: frozenset[str]

    @property
    def simulation_ids(self) -> I64:
        """Numbers of the simulations in the data set."""
        return self.group.simulation_ids

    @property
    def case(self) -> Case:
        """The simulations as the law reads them."""
        return self.group.case

    @property
    def trajectories(self) -> Trajectories:
        """Recorded states, scenarios and road."""
        return self.group.case.trajectories

    @property
    def states(self) -> States:
        """Recorded states of all vehicles."""
        return self.group.case.trajectories.states

    @property
    def signals(self) -> EgoSignals:
        """Signals of the egos."""
        return self.group.case.signals

    @property
    def road(self) -> Road:
        """The road that all simulations share."""
        return self.group.case.trajectories.road

    @cached_property
    def is_near(self) -> Mask:
        """Which vehicles are within reach of the ego, shape (simulation, vehicle, frame)."""
        s, reach = self.states.s, REACH_MM
        if self.road.is_two_way:
            is_other_direction = is_oncoming(self.trajectories)
            reach = np.where(is_other_direction, ONCOMING_REACH_MM, REACH_MM)[:, :, None]
        return self.trajectories.state_mask & (np.abs(s - s[:, [EGO_SLOT]]) <= reach)

    @cached_property
    def is_written_frame(self) -> Mask:
        """Which frames have positions and speeds, shape (simulation, frame).

        One frame in `frame_step`, the last, and all in which lanes, order or events change. Rules
        on lanes and order then conclude in the same frames, whatever the step.
        """
        events, valid = self.case.events, self.signals.valid
        frame = np.arange(valid.shape[1])
        is_written = (frame % self.frame_step == 0) | (frame == events.last[:, None])
        if self.frame_step > 1:
            is_written = is_written | _changed_frames(self.states.lane, self.is_near).any(axis=1)
            is_written |= _frames_with_new_order(self)
            for name in EVENT_NAMES:
                event_frame = getattr(events, name)[:, None]
                is_written |= (frame == event_frame) & (event_frame != NEVER)
            simulation, _, _, contact_frame = _contacts(self)
            is_written[simulation, contact_frame] = True
        return is_written & valid

    @cached_property
    def approaching(self) -> ApproachingVehicles:
        """Every vehicle that approaches an ego, in every frame."""
        if not self.road.is_two_way:
            no_index = np.zeros(0, np.intp)
            return ApproachingVehicles(
                simulation=no_index, frame=no_index, slot=no_index, gap=np.zeros(0, np.float32)
            )
        simulation, frame = np.nonzero(self.signals.valid)
        others = other_vehicles_at(self.trajectories, frame.astype(np.int32), simulation)
        index = instant, slot = np.nonzero(others.is_approaching)
        return ApproachingVehicles(
            simulation=simulation[instant],
            frame=frame[instant],
            slot=slot,
            gap=others.gap[index],
        )


def _changed_frames(values: NDArray[np.integer], valid: Mask) -> Mask:
    """Frames whose value differs from the frame before, of the same shape."""
    is_changed = np.zeros(valid.shape, np.bool_)
    is_changed[..., 1:] = valid[..., 1:] & valid[..., :-1] & (values[..., 1:] != values[..., :-1])
    return is_changed


def _frames_with_new_order(source: FactSource) -> Mask:
    """Frames in which a vehicle comes to be ahead of, beside or behind another one."""
    s, is_near = source.states.s, source.is_near
    length = rounded_up_mm(source.trajectories.scenario.vehicles.length).astype(np.int32)
    has_new_order = np.zeros((s.shape[0], s.shape[2]), np.bool_)
    for a in range(s.shape[1]):
        for b in range(a):
            # Twice the distance of the centres: half a length may end in half a millimetre.
            distance = np.int32(2) * (s[:, a] - s[:, b])
            lengths = (length[:, a] + length[:, b])[:, None]
            order = (distance >= lengths).astype(np.int8) - (distance <= -lengths)
            has_new_order |= _changed_frames(order, is_near[:, a] & is_near[:, b])
    return has_new_order


def _contacts(
    source: FactSource,
) -> tuple[IndexArray, IndexArray, NDArray[np.integer], NDArray[np.integer]]:
    """Row of the simulation, slot, partner and first frame at or after each contact."""
    contacts, last_frame = source.trajectories.contacts, source.trajectories.num_frames - 1
    simulation, slot = np.nonzero(contacts.partner != NO_VEHICLE)
    # The negated floor division rounds up.
    frame = -(-contacts.time[simulation, slot] // source.signals.frame_interval_ms)
    frame = np.minimum(frame, last_frame[simulation])
    return simulation, slot, contacts.partner[simulation, slot], frame


FactMeasurement = Callable[[FactSource], FactColumns]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fact(Predicate):
    """A predicate of facts.

    Attributes:
        measure: Returns the columns of its arguments.
        required_input: Constant of `UNKNOWN` without which there are no facts; None: no such input.
    """

    measure: FactMeasurement
    required_input: str | None = None


ROAD_FACTS: dict[str, Fact] = {}
"""Facts that all simulations of a data set share, by name."""

SIMULATION_FACTS: dict[str, Fact] = {}
"""Facts of the recording and the labels of a simulation, by name."""


def fact(
    facts: dict[str, Fact],
    name: str,
    meaning: str,
    *,
    required_input: str | None = None,
    unused_constants: Mapping[str, tuple[str, ...]] | None = None,
    **arguments: ArgumentType,
) -> Callable[[FactMeasurement], FactMeasurement]:
    """Declare the predicate whose facts the decorated function measures.

    Args:
        facts: The group that the predicate joins.
        name: Name of the predicate.
        meaning: Its statement about its arguments, for lists and headers of files.
        required_input: As in `Fact`.
        unused_constants: As in `Predicate`.
        arguments: Type of each argument, by its label, in the order of the columns.
    """

    def add(measure: FactMeasurement) -> FactMeasurement:
        facts[name] = Fact(
            name=name,
            meaning=meaning,
            arguments=arguments,
            unused_constants=unused_constants or {},
            measure=measure,
            required_input=required_input,
        )
        return measure

    return add


def measure_facts(facts: Iterable[Fact], source: FactSource) -> dict[str, FactColumns]:
    """The columns of each predicate whose input the recordings have."""
    unknown = source.trajectories.unknown
    return {fact.name: fact.measure(source) for fact in facts if fact.required_input not in unknown}


# Facts about the road.


@fact(ROAD_FACTS, "interval", "Time between two frames.", Ms=MILLISECONDS)
def _frame_interval(source: FactSource) -> FactColumns:
    return (np.array([source.trajectories.scenario.frame_interval_ms]),)


@fact(ROAD_FACTS, "road", "Kind of the road.", required_input="road_kind", Kind=ROAD)
def _road_kind(source: FactSource) -> FactColumns:
    kind = source.road.kind if source.road.kind in ROAD.constants else "other"
    return (np.array([ROAD.constants.index(kind)]),)


@fact(ROAD_FACTS, "lanes", "Number of driving lanes in the direction of travel.", N=LANE)
def _num_lanes(source: FactSource) -> FactColumns:
    return (np.array([source.road.num_lanes]),)


@fact(
    ROAD_FACTS,
    "opposing_lane",
    "The lane beyond the fastest one is for oncoming traffic.",
    Lane=LANE,
)
def _opposing_lane(source: FactSource) -> FactColumns:
    return (np.full(int(source.road.is_two_way), source.road.num_lanes),)


@fact(
    ROAD_FACTS,
    "posted_limit",
    "Posted speed limit, rounded; the highest where it changes along the road.",
    required_input="speed_limit",
    Limit=SPEED,
)
def _posted_limit(source: FactSource) -> FactColumns:
    return (nearest_mm(np.array([source.road.speed_limit])),)


@fact(
    ROAD_FACTS,
    "lower_limit",
    "A stretch with a limit below that one in the direction of travel; its ends rounded up.",
    required_input="speed_limit",
    From=MM,
    To=MM,
    Limit=SPEED,
)
def _lower_limits(source: FactSource) -> FactColumns:
    course = source.road.course
    limits = course.speed_limits_for(1) if course else ()
    table = np.array([(limit.start, limit.stop, limit.speed) for limit in limits]).reshape(-1, 3)
    return (
        _first_position_from(table[:, 0]),
        _first_position_from(table[:, 1]),
        nearest_mm(table[:, 2]),
    )


def _first_position_from(stations: NDArray[np.float64]) -> NDArray[np.int64]:
    """The first position in whole millimetres at or beyond each station, given in m [mm]."""
    first = np.ceil(stations / POSITION_RESOLUTION).astype(np.int64)
    # The quotient is rounded, so its ceiling may be one too high or one too low.
    first -= (first - 1) * POSITION_RESOLUTION >= stations
    return first + (first * POSITION_RESOLUTION < stations)


@fact(
    ROAD_FACTS,
    "border",
    "Lateral position of the border on the slow side of a lane.",
    Lane=LANE,
    D=MM,
)
def _borders(source: FactSource) -> FactColumns:
    road = source.road
    # Positive is left, the overtaking side; offsets of the road are positive to the geometric left.
    positions = nearest_mm(road.overtaking_sign * np.array(road.lane_boundaries))
    # The last border is the slow side of the lane beyond, the edge of the driving lanes.
    return np.arange(road.num_lanes + 1), positions


@fact(
    ROAD_FACTS,
    "lane_width",
    "Width of a driving lane, rounded down; also of a driving lane beyond the fast edge.",
    Lane=LANE,
    Width=MM,
)
def _lane_widths(source: FactSource) -> FactColumns:
    lanes, neighbour = list(source.road.lanes), source.road.overtaking_side_neighbour
    if neighbour is not None and neighbour.kind == "driving":
        lanes.append(neighbour)
    widths = np.array([lane.width for lane in lanes], np.float32)
    return np.arange(len(lanes)), rounded_down_mm(widths)


@fact(
    ROAD_FACTS,
    "mark",
    "The line on the slow side of a lane, as seen from the right or from the left.",
    required_input="marks",
    Lane=LANE,
    From=SIDE,
    Mark=MARK,
)
def _lane_marks(source: FactSource) -> FactColumns:
    road = source.road
    facts: list[tuple[int, int, int]] = []
    for index, lane in enumerate(road.lanes):
        slow_mark, fast_mark = _side_marks(road, lane)
        # A lane has its marks as seen from inside: the slow line from the left, and the fast line,
        # which is the slow line of the next lane, from the right. If the line on the fast side of
        # the last lane changes along the road, `line` has it.
        facts.append((index, SIDES.index("left"), _mark_code(slow_mark)))
        if index + 1 < road.num_lanes or not _has_varying_edge_mark(road):
            facts.append((index + 1, SIDES.index("right"), _mark_code(fast_mark)))
    border, side, mark = zip(*sorted(facts), strict=True)
    return np.array(border), np.array(side), np.array(mark)


def _side_marks(road: Road, lane: Lane) -> tuple[RoadMark, RoadMark]:
    """The marks on the slow and on the fast side of a lane; the road's sides are geometric."""
    if road.driving_side is DrivingSide.RIGHT:
        return lane.right_mark, lane.left_mark
    return lane.left_mark, lane.right_mark


def _mark_code(mark: RoadMark) -> int:
    return MARK.constants.index(mark.name.lower())


def _has_varying_edge_mark(road: Road) -> bool:
    """Whether the line on the fast side of the fastest lane changes along the road."""
    return len(road.overtaking_edge_marks) > 1


@fact(
    ROAD_FACTS,
    "line",
    "A stretch of the line on the fast side of the fastest lane, seen from there, if it changes.",
    required_input="marks",
    From=MM,
    To=MM,
    Mark=MARK,
)
def _edge_marks_along(source: FactSource) -> FactColumns:
    if not _has_varying_edge_mark(source.road):
        return no_facts(3)
    begins, marks = zip(*source.road.overtaking_edge_marks, strict=True)
    # Without infinity, which no integer holds: a road lies between 0 and `MAX_LENGTH`.
    ends = np.clip([*begins, np.inf], -MAX_LENGTH, 2.0 * MAX_LENGTH)
    codes = np.array([_mark_code(mark) for mark in marks])
    return nearest_mm(ends[:-1]), nearest_mm(ends[1:]), codes


@fact(
    ROAD_FACTS,
    "zone",
    "A stretch of road with a crest, a bend, a crossing or a sign for the direction of travel.",
    Kind=ZONE_KIND,
    From=MM,
    To=MM,
)
def _zones(source: FactSource) -> FactColumns:
    zones = all_zones_for(source.road, 1)
    codes = [ZONE_KIND.constants.index(zone.kind.name.lower()) for zone in zones]
    ends = np.array([(zone.start, zone.stop) for zone in zones]).reshape(-1, 2)
    return np.array(codes, np.int64), nearest_mm(ends[:, 0]), nearest_mm(ends[:, 1])


@fact(ROAD_FACTS, "unknown", "An input that the recordings lack.", What=UNKNOWN)
def _unknown_inputs(source: FactSource) -> FactColumns:
    codes = sorted(map(UNKNOWN.constants.index, source.trajectories.unknown))
    return (np.array(codes, np.int64),)


# Facts about a simulation and its labels.


@fact(SIMULATION_FACTS, "simulation", "There is such a simulation.", S=SIMULATION)
def _simulations(source: FactSource) -> FactColumns:
    return (source.simulation_ids,)


@fact(
    SIMULATION_FACTS,
    "rain",
    "Intensity of rain.",
    required_input="weather",
    S=SIMULATION,
    Percent=PERCENT,
)
def _rain(source: FactSource) -> FactColumns:
    return _percentages(source, source.trajectories.scenario.weather.rain)


@fact(
    SIMULATION_FACTS,
    "fog",
    "Density of fog.",
    required_input="weather",
    S=SIMULATION,
    Percent=PERCENT,
)
def _fog(source: FactSource) -> FactColumns:
    return _percentages(source, source.trajectories.scenario.weather.fog)


@fact(
    SIMULATION_FACTS,
    "wind",
    "Intensity of wind.",
    required_input="weather",
    S=SIMULATION,
    Percent=PERCENT,
)
def _wind(source: FactSource) -> FactColumns:
    return _percentages(source, source.trajectories.scenario.weather.wind)


def _percentages(source: FactSource, values: F32) -> FactColumns:
    """Numbers of the simulations, and a value of each as whole per cent."""
    return source.simulation_ids, np.rint(values).astype(np.int64)


@fact(SIMULATION_FACTS, "night", "It is night.", required_input="weather", S=SIMULATION)
def _nights(source: FactSource) -> FactColumns:
    return (source.simulation_ids[source.trajectories.scenario.weather.night],)


@fact(
    SIMULATION_FACTS,
    "class",
    "Class of the simulation under a policy, by the Python rules.",
    S=SIMULATION,
    Policy=POLICY,
    Class=CLASS,
)
def _classes(source: FactSource) -> FactColumns:
    classes = source.group.classes
    if classes is None:
        return no_facts(3)
    num_simulations, num_policies = classes.shape
    policy = np.tile(np.arange(num_policies), num_simulations)
    return np.repeat(source.simulation_ids, num_policies), policy, classes.reshape(-1)


@fact(
    SIMULATION_FACTS,
    "outcome",
    "How the ego's overtake ended, legality aside.",
    S=SIMULATION,
    Outcome=OUTCOME,
)
def _outcomes(source: FactSource) -> FactColumns:
    outcome = source.group.outcome
    return no_facts(2) if outcome is None else (source.simulation_ids, outcome)


@fact(SIMULATION_FACTS, "ego", "The vehicle whose overtaking is studied.", S=SIMULATION, V=VEHICLE)
def _egos(source: FactSource) -> FactColumns:
    return source.simulation_ids, np.full(len(source.simulation_ids), EGO_SLOT)


@fact(
    SIMULATION_FACTS,
    "vehicle",
    "A vehicle: its class, its length and its width, rounded up.",
    S=SIMULATION,
    V=VEHICLE,
    Kind=KIND,
    Length=SIZE,
    Width=SIZE,
)
def _vehicles(source: FactSource) -> FactColumns:
    vehicles = source.trajectories.scenario.vehicles
    index = simulation, slot = np.nonzero(vehicles.valid)
    return (
        source.simulation_ids[simulation],
        slot,
        vehicles.kind[index],
        rounded_up_mm(vehicles.length[index]),
        rounded_up_mm(vehicles.width[index]),
    )


@fact(
    SIMULATION_FACTS,
    "kind_unknown",
    "The recording lacks the class of the vehicle, or its length contradicts the class.",
    S=SIMULATION,
    V=VEHICLE,
)
def _vehicles_of_unknown_kind(source: FactSource) -> FactColumns:
    trajectories = source.trajectories
    simulation, slot = np.nonzero(trajectories.scenario.vehicles.valid & ~trajectories.known_kinds)
    return source.simulation_ids[simulation], slot


def _runs_of_frames(values: NDArray[np.integer], valid: Mask) -> tuple[I64, ...]:
    """Runs of frames in which values stay the same.

    Args:
        values: Shape (..., frame).
        valid: Which of them count, same shape; the others interrupt a run.

    Returns:
        For each run: its index along every leading axis, its value, its first and its last frame.
    """
    is_continued = valid[..., 1:] & valid[..., :-1] & (values[..., 1:] == values[..., :-1])
    is_first, is_last = valid.copy(), valid.copy()
    is_first[..., 1:] &= ~is_continued
    is_last[..., :-1] &= ~is_continued
    *index, first_frame = np.nonzero(is_first)
    last_frame = np.nonzero(is_last)[-1]
    value = values[(*index, first_frame)]
    return *index, value.astype(np.int64), first_frame, last_frame


@fact(
    SIMULATION_FACTS,
    "recorded",
    "The vehicle was recorded from frame to frame.",
    S=SIMULATION,
    V=VEHICLE,
    First=FRAME,
    Last=FRAME,
)
def _recorded_spans(source: FactSource) -> FactColumns:
    # Equal values: a run ends only where the vehicle is not recorded.
    simulation, slot, _, first, last = _runs_of_frames(
        np.zeros_like(source.states.lane), source.trajectories.state_mask
    )
    return source.simulation_ids[simulation], slot, first, last


@fact(
    SIMULATION_FACTS,
    "lane",
    "The vehicle's centre is in a lane.",
    S=SIMULATION,
    V=VEHICLE,
    Lane=LANE,
    First=FRAME,
    Last=FRAME,
)
def _lane_spans(source: FactSource) -> FactColumns:
    # As signed integers: code 255, beyond the slow edge, is lane -1.
    lanes = source.states.lane.view(np.int8)
    simulation, slot, lane, first, last = _runs_of_frames(lanes, source.trajectories.state_mask)
    return source.simulation_ids[simulation], slot, lane, first, last


@fact(
    SIMULATION_FACTS,
    "indicator",
    "The vehicle indicates.",
    required_input="indicators",
    S=SIMULATION,
    V=VEHICLE,
    Side=SIDE,
    First=FRAME,
    Last=FRAME,
)
def _indicator_spans(source: FactSource) -> FactColumns:
    lamps = indicator_to_kerb_side(source.road), indicator_to_overtaking_side(source.road)
    parts: list[FactColumns] = []
    for side, lamp in enumerate(lamps):  # In the order of `SIDES`.
        is_lit = (source.states.lights & np.uint8(lamp)) != 0
        is_lit &= source.trajectories.state_mask
        simulation, slot, _, first, last = _runs_of_frames(np.zeros(is_lit.shape, np.uint8), is_lit)
        side_codes = np.full(len(simulation), side)
        parts.append((source.simulation_ids[simulation], slot, side_codes, first, last))
    return concatenate_facts(parts, 5)


@fact(
    SIMULATION_FACTS,
    "neighbour",
    "The nearest vehicle in a role around the ego.",
    unused_constants={"Role": ("target",)},
    S=SIMULATION,
    Role=ROLE,
    V=VEHICLE,
    First=FRAME,
    Last=FRAME,
)
def _neighbour_spans(source: FactSource) -> FactColumns:
    slots = source.signals.neighbour_slot
    has_neighbour = source.signals.valid[:, None, :] & (slots != NO_VEHICLE)
    simulation, role, slot, first, last = _runs_of_frames(slots, has_neighbour)
    return source.simulation_ids[simulation], role, slot, first, last


@fact(
    SIMULATION_FACTS,
    "contact",
    "First frame after A has touched B.",
    S=SIMULATION,
    A=VEHICLE,
    B=VEHICLE,
    F=FRAME,
)
def _contact_frames(source: FactSource) -> FactColumns:
    simulation, *columns = _contacts(source)
    return source.simulation_ids[simulation], *columns


@fact(
    SIMULATION_FACTS, "event", "An event of the ego's overtake.", S=SIMULATION, Event=EVENT, F=FRAME
)
def _events(source: FactSource) -> FactColumns:
    frames = np.stack([getattr(source.case.events, name) for name in EVENT_NAMES], axis=1)
    simulation, event = np.nonzero(frames != NEVER)
    return source.simulation_ids[simulation], event, frames[simulation, event]


@fact(
    SIMULATION_FACTS,
    "target",
    "The vehicle that the ego overtakes, or would overtake.",
    S=SIMULATION,
    V=VEHICLE,
)
def _targets(source: FactSource) -> FactColumns:
    slot = source.case.events.target_slot
    return source.simulation_ids[slot != NO_VEHICLE], slot[slot != NO_VEHICLE]


@fact(
    SIMULATION_FACTS,
    "original_lane",
    "Lane in which the overtake began.",
    S=SIMULATION,
    Lane=LANE,
)
def _original_lanes(source: FactSource) -> FactColumns:
    # Code 255 is lane -1, as in `_lane_spans`.
    return source.simulation_ids, source.case.events.original_lane.astype(np.uint8).view(np.int8)


@fact(
    SIMULATION_FACTS,
    "drives_against",
    "The vehicle drives in the opposite direction of the road.",
    S=SIMULATION,
    V=VEHICLE,
)
def _vehicles_of_other_direction(source: FactSource) -> FactColumns:
    simulation, slot = np.nonzero(is_oncoming(source.trajectories))
    return source.simulation_ids[simulation], slot


@fact(SIMULATION_FACTS, "frame", "A frame with positions and speeds.", S=SIMULATION, F=FRAME)
def _written_frames(source: FactSource) -> FactColumns:
    simulation, frame = np.nonzero(source.is_written_frame)
    return source.simulation_ids[simulation], frame


@fact(
    SIMULATION_FACTS,
    "next",
    "G is the next such frame after F.",
    S=SIMULATION,
    F=FRAME,
    G=FRAME,
)
def _pairs_of_written_frames(source: FactSource) -> FactColumns:
    simulation, frame = np.nonzero(source.is_written_frame)
    is_same = simulation[1:] == simulation[:-1]
    simulation_ids = source.simulation_ids[simulation[1:][is_same]]
    return simulation_ids, frame[:-1][is_same], frame[1:][is_same]


@fact(
    SIMULATION_FACTS,
    "position",
    "Position of the vehicle's centre along the road.",
    S=SIMULATION,
    V=VEHICLE,
    F=FRAME,
    X=MM,
)
def _positions(source: FactSource) -> FactColumns:
    return _values_of_near_vehicles(source, source.states.s)


@fact(
    SIMULATION_FACTS,
    "speed",
    "Speed of the vehicle.",
    S=SIMULATION,
    V=VEHICLE,
    F=FRAME,
    Speed=SPEED,
)
def _speeds(source: FactSource) -> FactColumns:
    return _values_of_near_vehicles(source, source.states.speed)


def _values_of_near_vehicles(source: FactSource, values: NDArray[np.integer]) -> FactColumns:
    """Values of the vehicles within reach in the written frames."""
    is_written = source.is_near & source.is_written_frame[:, None, :]
    index = simulation, slot, frame = np.nonzero(is_written)
    return source.simulation_ids[simulation], slot, frame, values[index]
