"""Worlds that agree with what the ego notices when it begins an overtake.

People, unnoticed vehicles and the ego's own errors are drawn anew; worlds are kept in which the
model's ego notices the same as it did. That is approximate Bayesian computation by rejection:
noticed vehicles are proposed where the ego's errors would have them, the others anywhere within
`_AROUND`, each place as likely.

Source:
    Pritchard, Seielstad, Perez-Lezaun and Feldman, Population growth of human Y chromosomes, Mol.
    Biol. Evol. 16 (1999) 1791-1798: rejection by summary statistics.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.whatif.futures import Futures, copies
from overtaking.analysis.whatif.scenes import Scene
from overtaking.core.arrays import F32, U64, Mask
from overtaking.core.random_numbers import Stream, philox_words, uniform_from_word
from overtaking.model.scenario import Intervention, Scenario
from overtaking.model.trajectories import (
    POSITION_RESOLUTION,
    SPEED_RESOLUTION,
    ManoeuvreKind,
    Trajectories,
)
from overtaking.model.vehicles import EGO_SLOT, DriverTraits
from overtaking.scenarios import motorway_traffic as lanes_of_flow
from overtaking.scenarios.driver_sampling import drivers_with_speed, sample_traits
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.random_draws import RandomStream, SampleBlock
from overtaking.scenarios.traffic_specification import FlowTraffic
from overtaking.scenarios.vehicle_sampling import top_speeds
from overtaking.sim.branching import apply_intervention
from overtaking.world.constants import model_constants
from overtaking.world.step_parameters import step_parameters

_AROUND = 400.0
"""How far from the ego vehicles that it has not noticed may be [m]."""

_ROOM = 5.0
"""Least gap between two vehicles in a lane of a world that is proposed [m]."""

_GAP_TOLERANCE, _GAP_SHARE, _SPEED_TOLERANCE = 2.0, 0.1, 1.5
"""How much believed gaps [m], [1] and closing speeds [m/s] may differ."""

_AHEAD = np.array([1.0, 1.0, -1.0])
"""Direction of the vehicles in a percept: leader, front and rear of the next lane."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Percept:
    """What the ego notices when it begins: leader, front and rear of the next lane, shape (3,).

    Attributes:
        detected: Whether it has noticed a vehicle there.
        vehicle: Which vehicle.
        gap: Believed gap [m].
        closing: Believed speed of approach [m/s].
        true_gap: The gap as it is [m].
        true_closing: The speed of approach as it is [m/s].
    """

    detected: Mask
    vehicle: NDArray[np.int64]
    gap: NDArray[np.float64]
    closing: NDArray[np.float64]
    true_gap: NDArray[np.float64]
    true_closing: NDArray[np.float64]

    @classmethod
    def of(cls, run: Trajectories) -> "Percept | None":
        """That of the first simulation; None if its ego never begins."""
        rows = _starts(run)
        if rows[0] < 0:
            return None
        seen, at = run.percepts, (0, rows[0])
        return cls(
            detected=seen.is_detected[at],
            vehicle=seen.slot[at].astype(np.int64),
            gap=seen.gap[at].astype(np.float64) * POSITION_RESOLUTION,
            closing=seen.closing_speed[at].astype(np.float64) * SPEED_RESOLUTION,
            true_gap=seen.true_gap[at].astype(np.float64) * POSITION_RESOLUTION,
            true_closing=seen.true_closing_speed[at].astype(np.float64) * SPEED_RESOLUTION,
        )

    def is_shared_by(self, run: Trajectories) -> Mask:
        """In which simulations the ego notices the same when it begins, shape (simulation,)."""
        rows = _starts(run)
        place, seen = (np.arange(len(rows)), rows.clip(0)), run.percepts
        detected = seen.is_detected[place]
        gap = seen.gap[place] * POSITION_RESOLUTION
        closing = seen.closing_speed[place] * SPEED_RESOLUTION
        near = np.abs(gap - self.gap) <= _GAP_TOLERANCE + _GAP_SHARE * np.abs(self.gap)
        alike = near & (np.abs(closing - self.closing) <= _SPEED_TOLERANCE)
        same = (detected == self.detected) & (alike | ~self.detected)
        return (rows >= 0) & same.all(axis=1)


def proposals(
    scene: Scene, stayed: Trajectories, frame: int, percept: Percept, count: int
) -> Futures:
    """Worlds from a frame on that may agree with a percept.

    Args:
        scene: The simulation.
        stayed: The same with an ego that never begins.
        frame: The frame.
        percept: What the ego notices when it begins there.
        count: How many.
    """
    many = copies(scene.world, frame, count)
    noise = RandomStream(scene.scenario.seed, many.index, int(Stream.EXTERNAL_DRIVER))
    # The engine draws the errors of the first decision itself, so `judged` must be equal to them.
    judged = (
        _first_judgement_errors(scene.scenario.seed, many.index)
        if frame == 0
        else np.stack([noise.normal(), noise.normal()])
    )
    # Position and speed of every vehicle in one frame, shape (vehicle,).
    place = stayed.states.s[0, :, frame].astype(np.float64) * POSITION_RESOLUTION
    speed = stayed.states.speed[0, :, frame].astype(np.float64) * SPEED_RESOLUTION
    ahead, faster = _errors_undone(many.scenario, percept, judged)
    hidden = _unnoticed(stayed, frame, percept)
    for slot in hidden:
        ahead[:, slot] = _anywhere(noise.uniform(), place, slot)
    ahead = _room(scene, stayed, frame, place + ahead, place, hidden)
    moved = many.scenario.start_s + ahead.astype(np.float32)
    driven = many.scenario.start_speed + faster.astype(np.float32)
    drivers = _others(scene, many, stayed.states.lane[0, :, frame], speed + faster)
    scenario = many.scenario.replace(start_s=moved, start_speed=driven, drivers=drivers)
    for one in scene.world.interventions:  # Who was made another person is no other one.
        if one.frame <= frame and one.traits:
            scenario = apply_intervention(scenario, Intervention(slot=one.slot, traits=one.traits))
    return Futures(scenario=scenario, index=many.index, judged=judged)


def _starts(run: Trajectories) -> NDArray[np.int64]:
    """Row of the percept before the start of an overtake, -1 without one, shape (simulation,)."""
    is_start = run.percepts.valid & (run.percepts.kind == ManoeuvreKind.PULL_OUT)
    return np.where(is_start.any(axis=1), is_start.argmax(axis=1), -1)


def _first_judgement_errors(seed: int, scenario_index: U64) -> F32:
    """The ego's errors of distances and of speeds at the first decision, shape (2, simulation) [1].

    They are the uniform numbers of unit variance with which the engine starts these errors.

    Args:
        seed: Seed of the data set.
        scenario_index: Index of each scenario, shape (simulation,).
    """
    stream = Stream.MOTION + EGO_SLOT
    _, distance, speed, _ = philox_words(seed, scenario_index, stream, block_number=0)
    uniform_numbers = uniform_from_word(np.stack([distance, speed]))
    return np.sqrt(np.float32(3.0)) * (2.0 * uniform_numbers - 1.0).astype(np.float32)


def _errors_undone(
    scenario: Scenario, percept: Percept, judged: F32
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How far ahead [m] and faster [m/s] the noticed are if the ego errs so, (future, vehicle)."""
    step, c = step_parameters(scenario.select(slice(0, 1))).simulations, model_constants()
    of_gap = np.exp(float(step.distance_error[0]) * judged[0].astype(np.float64)) - 1.0
    of_speed = float(step.speed_error[0]) * judged[1].astype(np.float64)
    shape = (judged.shape[1], scenario.num_slots)
    ahead, faster = np.zeros(shape), np.zeros(shape)
    for k in np.flatnonzero(percept.detected):
        slot, gap, closing = int(percept.vehicle[k]), percept.gap[k], percept.closing[k]
        share = min(abs(gap) / max(closing * float(c.error_fade_time), 0.1), 1.0)
        sign = _AHEAD[k]
        ahead[:, slot] = sign * (gap / (1.0 + share * of_gap) - percept.true_gap[k])
        true = closing / (1.0 + share * of_speed) if closing else percept.true_closing[k]
        faster[:, slot] = -sign * (true - percept.true_closing[k])
    return ahead, faster


def _unnoticed(stayed: Trajectories, frame: int, percept: Percept) -> list[int]:
    """Slots of the vehicles that are there and that the ego does not notice when it begins."""
    noticed = {EGO_SLOT, *percept.vehicle[percept.detected].tolist()}
    there = np.flatnonzero(stayed.state_mask[0, :, frame]).tolist()
    return [slot for slot in there if slot not in noticed]


def _anywhere(u: F32, place: NDArray[np.float64], slot: int) -> NDArray[np.float64]:
    """Distance ahead of a vehicle that may be anywhere around the ego, shape (future,) [m]."""
    return place[EGO_SLOT] + _AROUND * (2.0 * u.astype(np.float64) - 1.0) - place[slot]


def _room(
    scene: Scene,
    stayed: Trajectories,
    frame: int,
    wanted: NDArray[np.float64],
    place: NDArray[np.float64],
    hidden: list[int],
) -> NDArray[np.float64]:
    """How far ahead all are, (future, vehicle) [m]: who would stand in another is far behind."""
    lane, length = stayed.states.lane[0, :, frame], scene.scenario.vehicles.length[0]
    for slot in hidden:
        others = np.flatnonzero(stayed.state_mask[0, :, frame] & (lane == lane[slot]))
        for other in others[others != slot]:
            least = 0.5 * (length[slot] + length[other]) + _ROOM
            hits = np.abs(wanted[:, slot] - wanted[:, other]) < least
            wanted[:, slot] = np.where(hits, place[EGO_SLOT] - 2.0 * _AROUND, wanted[:, slot])
    return wanted - place


def _others(
    scene: Scene, many: Futures, lane: NDArray[np.uint8], speed: NDArray[np.float64]
) -> DriverTraits:
    """Other people in the other vehicles, who drive as fast as these do."""
    given, kind = load_specification(scene.data.manifest.identity.spec), many.scenario.vehicles.kind
    road, seed = scene.scenario.road, scene.scenario.seed
    traits = sample_traits(SampleBlock.from_indices(given, road, seed, many.index), kind)
    driven, top = speed.astype(np.float32), top_speeds()[kind]
    if isinstance(given.traffic, FlowTraffic):
        lanes = np.minimum(lane, scene.scenario.road.num_lanes - 1)
        free = lanes_of_flow.desired_speeds(
            given.traffic, traits["cruise_factor"], kind, np.broadcast_to(lanes, kind.shape)
        )
        wish = np.maximum(free, driven)
    else:
        wish = driven * traits["cruise_factor"]
    drawn = drivers_with_speed(traits, np.minimum(wish, top))
    own = many.scenario.drivers
    rows = {}
    for name in DriverTraits.__slots__:
        rows[name] = getattr(drawn, name).copy()
        rows[name][:, EGO_SLOT] = getattr(own, name)[:, EGO_SLOT]
    return own.replace(**rows)
