"""The features of Pinto, Dutra and Fonseca (2023) in two readings, "paper" and "matched".

The paper measures an overtake in the frame in which it begins, and a simulation without an attempt
by the mean over all of its frames. The features then reveal whether there is an attempt, so a model
may learn from the reading "matched" only: it measures every simulation at one frame. Without an
attempt this frame is a pseudo attempt, after a waiting time drawn from the waiting times of
attempts and limited to the time for which the ego followed.

An event is a frame of each simulation, `NEVER` (-1) if it does not occur. Left is the overtaking
side, also in left-hand traffic.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, I32
from overtaking.core.float32_math import as_f32, maximum
from overtaking.core.native import PhiloxStream
from overtaking.core.random_numbers import Stream
from overtaking.knowledge.quantities import Quantity
from overtaking.knowledge.toml_reader import all_quantities
from overtaking.labels.event_detection import nan_if_begun_before_recording
from overtaking.labels.law.case import scans, seconds_of
from overtaking.labels.snapshots import (
    METRES_PER_MM,
    LeftLaneOccupancy,
    at_frame,
    left_lane_occupancy,
    slot_or_ego,
    vehicle_snapshot,
)
from overtaking.model.batch import cached_per_batch
from overtaking.model.overtake_events import NEVER
from overtaking.model.overtake_features import PaperFeatures
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import Case


def paper_features(case: Case) -> PaperFeatures:
    """The features of a batch under the paper's reading.

    The waiting time counts from the first frame to the attempt; without an attempt, to a collision
    or the end of the recording. The overtaking time ends with the return, a collision or the
    recording; without an attempt it is 0. The difference of speeds has no sign, the distance is
    between the centres, and the occupancy is the number of vehicles in the lane to the left over
    the number of all vehicles but the ego.
    """
    events, has_attempt = case.events, case.events.has_attempt
    end_of_waiting = np.where(
        has_attempt, events.attempt, _first_event_or_last_frame(case, events.collision)
    )
    end = _first_event_or_last_frame(case, events.collision, events.return_end)
    num_frames_of_overtake = np.where(has_attempt, end - events.attempt, np.int32(0))
    at_attempt, means = _at_attempt(case), _means_without_attempt(case)
    return PaperFeatures(
        reading="paper",
        waiting_time=nan_if_begun_before_recording(case, seconds_of(case, end_of_waiting)),
        overtaking_time=nan_if_begun_before_recording(
            case, seconds_of(case, num_frames_of_overtake)
        ),
        frame=np.where(has_attempt, events.attempt, NEVER),
        **{name: np.where(has_attempt, at_attempt[name], means[name]) for name in at_attempt},
        **_static_features(case),
    )


def matched_features(case: Case) -> PaperFeatures:
    """The features of a batch, measured at the attempt or pseudo attempt.

    The waiting time counts from the frame in which the ego begins to follow the target, the
    difference of speeds is positive while the gap shrinks, the distance is the gap between the
    bumpers, and the occupancy is the share of the left lane that vehicles cover, within 100 m of
    the ego. The end of an abort ends the overtaking time; the paper's reading ignores it.
    """
    events = case.events
    has_attempt = events.has_attempt
    frame = matched_frame(case)
    num_frames_of_waiting = np.maximum(frame - events.following_begin, 0)
    end = _first_event_or_last_frame(case, events.collision, events.return_end, events.abort_end)
    num_frames_of_overtake = np.where(has_attempt, np.maximum(end - events.attempt, 0), np.int32(0))
    ego_speed = at_frame(case.signals.speed, frame)
    target = _target_at(case, frame)
    has_target = events.target_slot != NO_VEHICLE
    return PaperFeatures(
        reading="matched",
        waiting_time=nan_if_begun_before_recording(case, seconds_of(case, num_frames_of_waiting)),
        overtaking_time=nan_if_begun_before_recording(
            case, seconds_of(case, num_frames_of_overtake)
        ),
        ego_speed=ego_speed,
        target_speed=target["speed"],
        speed_difference=np.where(has_target, ego_speed - target["speed"], np.float32(0.0)),
        distance=target["gap"],
        left_occupancy=left_lane_at_matched_frame(case).occupancy,
        frame=frame,
        **_static_features(case),
    )


def _at_attempt(case: Case) -> dict[str, F32]:
    """Features of the paper's reading at the attempt; undefined without an attempt."""
    ego_speed = at_frame(case.signals.speed, case.events.attempt)
    target = _target_at(case, case.events.attempt)
    # With an attempt, the matched frame is its frame.
    left_lane = left_lane_at_matched_frame(case)
    num_others = np.maximum(case.trajectories.scenario.num_vehicles - 1, 1)
    return {
        "ego_speed": ego_speed,
        "target_speed": target["speed"],
        "speed_difference": np.abs(ego_speed - target["speed"]),
        "distance": np.abs(target["ego_lead"]),
        "left_occupancy": as_f32(left_lane.count) / as_f32(num_others),
    }


def _means_without_attempt(case: Case) -> dict[str, F32]:
    """Means over the frames up to a collision, 0 in simulations with an attempt.

    Here the leader of each frame is the target. The sums are of recorded integers, in mm, mm/s and
    vehicles, so they have no rounding error.
    """
    sums = scans(case).recorded_sums
    num_others = np.maximum(case.trajectories.scenario.num_vehicles - 1, 1)

    def mean(name: str, count: str) -> F32:
        """Mean of a recorded quantity over the frames that `count` counts."""
        return as_f32(sums[name] / np.maximum(sums[count], 1))

    return {
        "ego_speed": mean("ego_speed", "frames") * METRES_PER_MM,
        "target_speed": mean("target_speed", "frames_with_leader") * METRES_PER_MM,
        "speed_difference": mean("speed_difference", "frames_with_leader") * METRES_PER_MM,
        "distance": mean("distance", "frames_with_leader") * METRES_PER_MM,
        "left_occupancy": mean("left_count", "frames") / as_f32(num_others),
    }


@cached_per_batch
def matched_frame(case: Case) -> I32:
    """The frame of the attempt or pseudo attempt, shape (simulation,)."""
    attempt = np.where(case.events.has_attempt, case.events.attempt, pseudo_attempt(case))
    return attempt.astype(np.int32, copy=False)


@cached_per_batch
def left_lane_at_matched_frame(case: Case) -> LeftLaneOccupancy:
    """The lane to the left at `matched_frame`."""
    return left_lane_occupancy(case.trajectories, np.maximum(matched_frame(case), 0))


@cached_per_batch
def pseudo_attempt(case: Case) -> I32:
    """The frame in which a simulation without an attempt is measured; `NEVER` with an attempt.

    The waiting time until that frame is drawn from the distribution of the waiting times of the
    attempts of a profile, a named kind of simulations. The distribution is truncated to times
    below the time for which the ego followed. `following_begin` is never `NEVER`: it is frame 0 if
    the ego never follows.
    """
    scenario, events = case.trajectories.scenario, case.events
    quantiles = _waiting_time_quantiles(scenario.profile)
    draw = PhiloxStream(scenario.seed, scenario.scenario_index, Stream.MATCHED_INSTANT).uniform()
    end = _first_event_or_last_frame(case, events.collision)
    following_time = seconds_of(case, np.maximum(end - events.following_begin, 0))
    # A uniform number times the share below the bound is a uniform number from 0 to that share.
    waiting_time = _quantile(quantiles, draw * _share_below(quantiles, following_time))
    num_frames = np.rint(waiting_time * np.float32(1000.0 / case.signals.frame_interval_ms))
    frame = np.minimum(events.following_begin + num_frames.astype(np.int32), end)
    return np.where(events.has_attempt, NEVER, frame)


def _waiting_time_quantiles(profile: str) -> F32:
    """Minimum, deciles and maximum of the waiting times of a profile's attempts [s].

    The quantiles are fixed for each profile: with quantiles of the present data set, the features
    of a simulation would depend on the other simulations. `calibration/waiting_times.py` measures
    them. Recordings and profiles without an entry have the quantiles of `pinto2023-physical`, a
    choice.
    """
    table, quantities = "matched.waiting_time_quantiles", all_quantities("event_detection.toml")
    quantiles = quantities.get(f"{table}.{profile}", quantities[f"{table}.pinto2023-physical"])
    assert isinstance(quantiles, Quantity)
    return as_f32(quantiles.value)


def _quantile(quantiles: F32, share: F32) -> F32:
    """Value below which a share of a distribution lies, linear between its quantiles.

    The quantiles belong to evenly spaced shares from 0 to 1.
    """
    rank = share * np.float32(len(quantiles) - 1)
    low = np.minimum(rank.astype(np.int32), len(quantiles) - 2)
    fraction = rank - as_f32(low)
    return quantiles[low] + fraction * (quantiles[low + 1] - quantiles[low])


def _share_below(quantiles: F32, value: F32) -> F32:
    """Share of a distribution that lies below a value; the inverse of `_quantile`."""
    low = np.searchsorted(quantiles, value, side="right") - 1
    low = np.clip(low, 0, len(quantiles) - 2)
    # Two quantiles may be equal: the bound avoids a division by 0.
    step = maximum(quantiles[low + 1] - quantiles[low], np.float32(1e-6))
    fraction = np.clip((value - quantiles[low]) / step, np.float32(0.0), np.float32(1.0))
    return (as_f32(low) + as_f32(fraction)) / np.float32(len(quantiles) - 1)


def _first_event_or_last_frame(case: Case, *events: I32) -> I32:
    """Frame of an event, else the last frame, shape (simulation,).

    Of events that happen in the same simulation, the one that is listed first counts, even if it is
    later in time: a collision after the return belongs to the overtake.
    """
    end = case.events.last
    for event in reversed(events):
        end = np.where(event == NEVER, end, event)
    return end


def _target_at(case: Case, frame: I32) -> dict[str, F32]:
    """Speed, lead and gap of the target at one frame of each simulation.

    By the definition of `PaperFeatures` they are 0 without a target, and NaN if it is not recorded
    in that frame; lead and gap, but not the speed, are NaN if the attempt began before the
    recording.
    """
    slot = case.events.target_slot
    target = vehicle_snapshot(case.trajectories, slot, np.arange(len(frame)), frame)
    default = np.where(slot == NO_VEHICLE, np.float32(0.0), np.float32(np.nan))

    def if_recorded(values: F32) -> F32:
        return np.where(target.valid, values, default)

    return {
        "speed": if_recorded(target.speed),
        "ego_lead": nan_if_begun_before_recording(case, if_recorded(target.ego_lead)),
        "gap": nan_if_begun_before_recording(case, if_recorded(target.gap)),
    }


def _static_features(case: Case) -> dict[str, NDArray[Any]]:
    """Features that do not change during a simulation, by field of `PaperFeatures`."""
    scenario, target = case.trajectories.scenario, case.events.target_slot
    weather, kind = scenario.weather, scenario.vehicles.kind
    has_target = target != NO_VEHICLE
    slot = slot_or_ego(target)
    return {
        "night": weather.night,
        "low_sun": weather.low_sun,
        "ego_kind": kind[:, EGO_SLOT],
        "target_kind": np.where(has_target, kind[np.arange(len(slot)), slot], 0),
        "has_target": has_target,
        "num_vehicles": scenario.num_vehicles.astype(np.uint8),
        "rain": weather.rain,
        "wind": weather.wind,
        "fog": weather.fog,
    }
