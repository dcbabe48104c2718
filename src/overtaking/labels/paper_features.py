"""The study's features in two readings: as it measures them, and alike in every class.

The study measures an overtake in the frame in which it begins, and a run without an attempt by the
mean over all of its frames: a definition that depends on the class. A model may learn from the
second reading only. There, where nothing was attempted, an instant stands for the attempt: after a
waiting time with the distribution of the attempts, within the time for which the ego did follow.
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

    The waiting time counts from the first frame, and without an attempt is the whole duration. The
    overtaking time ends with the return, a collision or the recording, and is 0 without an attempt.
    The difference of speeds has no sign, the distance is between the centres, and the occupancy is
    the number of vehicles in the lane to the left over the number of all others.
    """
    events = case.events
    attempted = events.has_attempt
    waited = np.where(attempted, events.attempt, _first_event_or_last_frame(case, events.collision))
    ended = _first_event_or_last_frame(case, events.collision, events.return_end)
    lasted = np.where(attempted, ended - events.attempt, np.int32(0))
    instant, mean = _at_attempt(case), _means_without_attempt(case)
    measured = {name: np.where(attempted, instant[name], mean[name]) for name in instant}
    return PaperFeatures(
        reading="paper",
        waiting_time=nan_if_begun_before_recording(case, seconds_of(case, waited)),
        overtaking_time=nan_if_begun_before_recording(case, seconds_of(case, lasted)),
        frame=np.where(attempted, events.attempt, NEVER),
        **measured,
        **_static_features(case),
    )


def matched_features(case: Case) -> PaperFeatures:
    """The features of a batch, measured at `t_a` or at an instant that stands for it.

    The waiting time counts from the frame in which the ego closes up to the target, the difference
    of speeds is positive while it closes, the distance is the gap between the bumpers, and the
    occupancy is the share of 100 m of the lane to the left, ahead and behind, that vehicles cover.
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
    ego_speed = at_frame(case.signals.speed, case.events.attempt)
    target = _target_at(case, case.events.attempt)
    left_lane = left_lane_at_matched_frame(case)  # Unused without an attempt.
    num_others = np.maximum(case.trajectories.scenario.num_vehicles - 1, 1)
    return {
        "ego_speed": ego_speed,
        "target_speed": target["speed"],
        "speed_difference": np.abs(ego_speed - target["speed"]),
        "distance": np.abs(target["ego_lead"]),
        "left_occupancy": as_f32(left_lane.count) / as_f32(num_others),
    }


def _means_without_attempt(case: Case) -> dict[str, F32]:
    """Means over the frames up to a collision, 0 where there is an attempt.

    They are means of the recorded integers, so that no digit is lost.
    """
    total = scans(case).recorded_sums
    others = np.maximum(case.trajectories.scenario.num_vehicles - 1, 1)

    def mean(name: str, counted: str) -> F32:
        return as_f32(total[name] / np.maximum(total[counted], 1))

    return {
        "ego_speed": mean("ego_speed", "frames") * METRES_PER_MM,
        "target_speed": mean("target_speed", "led") * METRES_PER_MM,
        "speed_difference": mean("speed_difference", "led") * METRES_PER_MM,
        "distance": mean("distance", "led") * METRES_PER_MM,
        "left_occupancy": mean("left_count", "frames") / as_f32(others),
    }


@cached_per_batch
def matched_frame(case: Case) -> I32:
    """The attempt, or the instant that stands for it, shape (simulation,)."""
    attempt = np.where(case.events.has_attempt, case.events.attempt, pseudo_attempt(case))
    return attempt.astype(np.int32, copy=False)


@cached_per_batch
def left_lane_at_matched_frame(case: Case) -> LeftLaneOccupancy:
    """The lane to the left at that moment."""
    return left_lane_occupancy(case.trajectories, np.maximum(matched_frame(case), 0))


@cached_per_batch
def pseudo_attempt(case: Case) -> I32:
    """The instant that stands for `t_a` where nothing was attempted, shape (simulation,).

    The inverse of the distribution of the waiting times of the profile's attempts, cut off at the
    time for which the ego followed, at a uniform number from a stream of its own.
    """
    scenario, events = case.trajectories.scenario, case.events
    quantiles = _waiting_time_quantiles(scenario.profile)
    draw = PhiloxStream(scenario.seed, scenario.scenario_index, Stream.MATCHED_INSTANT).uniform()
    end = _first_event_or_last_frame(case, events.collision)
    longest = seconds_of(case, np.maximum(end - events.following_begin, 0))
    waited = _quantile(quantiles, draw * _share_below(quantiles, longest))
    frames = np.rint(waited * np.float32(1000.0 / case.signals.frame_interval_ms))
    frame = np.minimum(events.following_begin + frames.astype(np.int32), end)
    return np.where(events.has_attempt, NEVER, frame)


def _waiting_time_quantiles(profile: str) -> F32:
    """Minimum, deciles and maximum of the waiting times of a profile's attempts [s]."""
    table, quantities = "matched.waiting_time_quantiles", all_quantities("event_detection.toml")
    quantiles = quantities.get(f"{table}.{profile}", quantities[f"{table}.pinto2023-physical"])
    assert isinstance(quantiles, Quantity)
    return as_f32(quantiles.value)


def _quantile(quantiles: F32, share: F32) -> F32:
    """Value below which a share lies, linear between evenly spaced quantiles."""
    steps = np.float32(len(quantiles) - 1)
    rank = share * steps
    low = np.minimum(rank.astype(np.int32), len(quantiles) - 2)
    part = rank - as_f32(low)
    return quantiles[low] + part * (quantiles[low + 1] - quantiles[low])


def _share_below(quantiles: F32, value: F32) -> F32:
    """Share that lies below a value; the inverse of `_quantile`."""
    last = len(quantiles) - 2
    low = np.clip(np.searchsorted(quantiles, value, side="right") - 1, 0, last)
    step = maximum(quantiles[low + 1] - quantiles[low], np.float32(1e-6))
    part = np.clip((value - quantiles[low]) / step, np.float32(0.0), np.float32(1.0))
    return (as_f32(low) + as_f32(part)) / np.float32(len(quantiles) - 1)


def _first_event_or_last_frame(case: Case, *events: I32) -> I32:
    """The first in the list of events that happened, else the last frame, shape (simulation,)."""
    end = case.events.last
    for event in reversed(events):
        end = np.where(event == NEVER, end, event)
    return end


def _target_at(case: Case, frame: I32) -> dict[str, F32]:
    """Speed, lead and gap of the target at one frame of each simulation.

    0 where there is no target; NaN where it is not recorded in that frame, and for lead and gap
    where the attempt began before the recording.
    """
    vehicle = case.target.slot
    along = vehicle_snapshot(case.trajectories, vehicle, np.arange(len(frame)), frame)
    missing = np.where(vehicle == NO_VEHICLE, np.float32(0.0), np.float32(np.nan))

    def nan_unless_recorded(values: F32) -> F32:
        return np.where(along.valid, values, missing)

    return {
        "speed": nan_unless_recorded(along.speed),
        "ego_lead": nan_if_begun_before_recording(case, nan_unless_recorded(along.ego_lead)),
        "gap": nan_if_begun_before_recording(case, nan_unless_recorded(along.gap)),
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
