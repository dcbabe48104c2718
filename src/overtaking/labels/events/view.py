"""What attempts are looked for in: the ego, its lane and its leader, frame by frame."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask, as_f32
from overtaking.labels.events.accidents import Accidents
from overtaking.labels.events.movements import num_frames_of
from overtaking.labels.signals.frames import earliest, until
from overtaking.labels.signals.reference import side_of
from overtaking.model.batch import Batch
from overtaking.model.events import NEVER
from overtaking.model.road import Road
from overtaking.model.signals import Around, Signals
from overtaking.model.trajectory import NO_VEHICLE, Trajectories
from overtaking.model.vehicles import Role, VehicleKind
from overtaking.world.constants import known

I32 = NDArray[np.int32]
U8 = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class View(Batch):
    """What attempts are looked for in; arrays have shape (simulation, time) unless said.

    Attributes:
        simulation: Number of each simulation in the batch, shape (simulation,).
        valid: Frames before any accident.
        lane: As in `Signals`.
        lateral: As in `Signals`.
        lateral_speed: As in `Signals`.
        left_reach: As in `Signals`.
        right_reach: As in `Signals`.
        line: Left border of the ego's lane [m].
        has_left: Whether there is a driving lane to the left of the ego's lane.
        is_out: Whether a corner of the ego is over the left line of a lane that it had been in.
        lately_ahead: Slot of the leader, or of the last one if that was just now.
        least_advance: What gusts and wandering do not reach, of its class, shape (simulation,) [m].
    """

    simulation: NDArray[np.int64]
    valid: Mask
    lane: U8
    lateral: F32
    lateral_speed: F32
    left_reach: F32
    right_reach: F32
    line: F32
    has_left: Mask
    is_out: Mask
    lately_ahead: U8
    least_advance: F32

    @property
    def num_frames(self) -> int:
        """Frames of the longest simulation."""
        return self.valid.shape[1]


def view_of(trajectories: Trajectories, seen: Signals, ended: Accidents) -> View:
    """What attempts are looked for in.

    Args:
        trajectories: The recording.
        seen: Its signals.
        ended: Where each simulation ends early.
    """
    valid = seen.valid & until(earliest(ended.collision, ended.road_departure), seen.num_frames)
    line = left_line(trajectories.road, seen.lane)
    kind = trajectories.scenario.vehicles.kind[:, Role.EGO]
    return View(
        simulation=np.arange(len(valid)),
        valid=valid,
        lane=seen.lane,
        lateral=seen.lateral,
        lateral_speed=seen.lateral_speed,
        left_reach=seen.left_reach,
        right_reach=seen.right_reach,
        line=line,
        has_left=seen.lane < lanes_with_left(trajectories.road),
        is_out=valid & _is_out(seen, line),
        lately_ahead=_lately_ahead(trajectories, seen),
        least_advance=least_advances()[kind],
    )


def borders_of(road: Road) -> F32:
    """Lane borders from the right to the left, shape (lane + 1,) [m]."""
    return side_of(road) * as_f32(road.boundaries)


def left_line(road: Road, lane: U8) -> F32:
    """Left border of lanes; the last border for what is beyond the lanes [m]."""
    borders = borders_of(road)
    return borders[np.minimum(lane.astype(np.intp) + 1, len(borders) - 1)]


def lanes_with_left(road: Road) -> int:
    """Number of lanes, from the slowest on, that have a driving lane to their left."""
    beyond = road.fast_side_neighbour
    return road.num_lanes - 1 + int(beyond is not None and beyond.kind == "driving")


def least_advances() -> F32:
    """The advance within a second that is more than gusts and wandering, by `VehicleKind` [m]."""
    return np.array([known(f"labels.attempt.advance.{kind.name}") for kind in VehicleKind])


def _entered(seen: Signals) -> I32:
    """Frame in which the ego's centre came into the lane that it is in, (simulation, time)."""
    frame = np.arange(seen.num_frames, dtype=np.int32)
    changes = np.zeros(seen.lane.shape, np.bool_)
    changes[:, 1:] = seen.lane[:, 1:] != seen.lane[:, :-1]
    return np.maximum.accumulate(np.where(changes, frame, np.int32(0)), axis=1)


def _is_out(seen: Signals, line: F32) -> Mask:
    """Whether a corner is over the left line of a lane in which the whole left side has been.

    It has been there if it was for `motion.least_time` since the centre came, or in the first
    frame. A recording may also begin while the ego leaves its lane to the left.
    """
    over = seen.left_reach > line + known("labels.attempt.over_line")
    frame, entered = np.arange(seen.num_frames, dtype=np.int32), _entered(seen)
    last_over = np.maximum.accumulate(np.where(over, frame, NEVER), axis=1)
    begin = np.maximum(last_over + np.int32(1), entered)
    least = num_frames_of(seen, "motion.least_time")
    been = ~over & ((frame - begin + 1 >= least) | (begin == 0))
    been[:, 0] |= seen.lateral_speed[:, 0] > known("labels.motion.least_speed")
    latest = np.maximum.accumulate(np.where(been, frame, NEVER), axis=1)
    return over & (latest >= entered)


def _lately_ahead(trajectories: Trajectories, seen: Signals) -> U8:
    """Slot of the leader, or of the last one if that was just now; shape (simulation, time).

    A leader that makes room to the right while the ego pulls out to the left is overtaken no less.
    One of another lane, before the ego came here, is not, nor one that is no longer recorded.
    """
    leader, has = seen.vehicle[:, Around.LEADER], seen.has(Around.LEADER)
    frame = np.arange(seen.num_frames, dtype=np.int32)
    latest = np.maximum.accumulate(np.where(has, frame, NEVER), axis=1)
    lately = frame - latest <= num_frames_of(seen, "motion.median_window")
    lately &= latest >= _entered(seen)
    found = np.take_along_axis(leader, np.maximum(latest, 0), axis=1)
    if trajectories.present is not None:
        slot = np.where(lately, found, np.uint8(Role.EGO))
        lately &= trajectories.present[np.arange(len(slot))[:, None], slot, frame]
    return np.where(lately, found, NO_VEHICLE)
