"""Where two recordings part, and how each ends."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking.cli import comparison
from overtaking.labels.labelling import label
from overtaking.model.batch import concatenate
from overtaking.model.overtake_events import Outcome
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.sim import engine
from overtaking.simulators.comparison import (
    TOGETHER,
    Comparison,
    ending,
    lane_changes,
    parting,
    weather_names,
)

ROAD = wide_road()
NAMES = ("engine", "sumo", "carla")


@pytest.fixture(scope="module")
def run():
    """Three simulations of two vehicles that drive on at their speeds, 41 frames each."""
    pair = [Vehicle(s=0.0, speed=25.0), Vehicle(s=80.0, lane=1, speed=25.0)]
    return engine.simulate(scenario(*[pair] * 3, road=ROAD, horizon=2.0))


def moved(run, *, vehicle, frames, s=0, d=0, row=1):
    """The recording with a vehicle of one simulation elsewhere in some frames [mm]."""
    states = run.states
    new = {"s": states.s.copy(), "d": states.d.copy()}
    new["s"][row, vehicle, frames] += s
    new["d"][row, vehicle, frames] += d
    return run.replace(states=dataclasses.replace(states, **new))


def compared(*runs):
    return Comparison.of(
        NAMES[: len(runs)], [(run, label(run).labels) for run in runs], policy="paper"
    )


# --- where they part ---


def test_a_recording_never_parts_from_itself(run):
    found = parting(run, run)
    assert found.frame.tolist() == [TOGETHER] * 3
    assert found.vehicle.tolist() == [NO_VEHICLE] * 3
    assert np.isinf(compared(run, run).times).all()


def test_they_part_where_a_vehicle_is_more_than_two_metres_away(run):
    there = moved(moved(run, vehicle=1, frames=slice(7, None), s=2000), vehicle=1, frames=12, s=1)
    found = parting(run, there)
    assert found.frame.tolist() == [TOGETHER, 12, TOGETHER]
    assert found.vehicle[1] == 1
    assert found.along[1] == pytest.approx(2.001)
    assert found.s[1] == pytest.approx(run.states.s[1, 1, 12] / 1000)
    assert compared(run, there).times[0, 1] == pytest.approx(0.6)


def test_distance_counts_in_both_directions_together(run):
    near = moved(run, vehicle=0, frames=slice(5, None), s=1500, d=1300)
    far = moved(run, vehicle=0, frames=slice(5, None), s=-1500, d=1400)
    assert parting(run, near).frame[1] == TOGETHER
    found = parting(run, far)
    assert (found.frame[1], found.vehicle[1]) == (5, 0)
    assert (found.along[1], found.left[1]) == (pytest.approx(-1.5), pytest.approx(1.4))


def test_the_vehicle_named_is_the_one_farthest_away(run):
    both = moved(run, vehicle=0, frames=slice(9, None), s=3000)
    both = moved(both, vehicle=1, frames=slice(9, None), d=4000)
    assert parting(run, both).vehicle[1] == 1


def test_what_comes_after_the_end_of_one_recording_is_not_compared(run):
    there = moved(run, vehicle=0, frames=slice(20, None), s=9000)
    short = np.array([41, 20, 41], np.int32)
    assert parting(run, there.replace(num_frames=short)).frame[1] == TOGETHER
    assert parting(run.replace(num_frames=short), there).frame[1] == TOGETHER
    assert parting(run, there).frame[1] == 20


def test_empty_slots_never_part(run):
    assert parting(run, moved(run, vehicle=5, frames=slice(0, None), s=9000)).frame[1] == TOGETHER


def test_other_scenarios_are_refused(run):
    others = run.scenario.replace(scenario_index=run.scenario.scenario_index + np.uint64(1))
    with pytest.raises(ValueError, match="not of the same scenarios"):
        parting(run, run.replace(scenario=others))


# --- how they end ---


@pytest.mark.parametrize("policy", ["paper", "default", "strict"])
def test_classes_are_those_of_the_policy(run, policy):
    labels = label(run).labels
    endings = ending((run, labels), policy)
    place = labels.policies.index(policy)
    assert endings.classes.tolist() == labels.classes[:, place].tolist()
    assert endings.outcome.tolist() == [Outcome.NO_ATTEMPT] * 3
    with pytest.raises(ValueError, match="not in tuple"):
        ending((run, labels), "other")


def test_a_contact_of_others_is_told_and_is_no_collision_of_the_ego(run):
    partner = run.contacts.partner.copy()
    partner[1, 1] = 2
    hit = run.replace(contacts=run.contacts.replace(partner=partner))
    endings = ending((hit, label(hit).labels), "paper")
    assert endings.has_contact.tolist() == [False, True, False]
    assert endings.outcome[1] == Outcome.NO_ATTEMPT


def test_a_lane_change_counts_when_the_middle_of_the_other_lane_is_reached(run):
    width = 3500
    out = moved(run, vehicle=0, frames=slice(10, 30), d=width)
    crossing = moved(run, vehicle=0, frames=slice(10, 30), d=width // 2 + 200)
    for there, count in ((out, 2), (crossing, 0)):
        lane = np.where(there.states.d[:, 0] > ROAD.lane_boundaries[1] * 1000, 1, 0).astype(
            np.uint8
        )
        states = there.states.replace(lane=there.states.lane.copy())
        states.lane[:, 0] = lane
        assert lane_changes(there.replace(states=states)).tolist() == [0, count, 0]


# --- all of it ---


def test_comparisons_of_parts_are_the_comparison_of_the_whole(run):
    there = moved(run, vehicle=1, frames=slice(7, None), s=5000)
    parts = [compared(run.select(rows), there.select(rows)) for rows in (slice(0, 1), slice(1, 3))]
    joined, whole = concatenate(parts), compared(run, there)
    assert joined.partings[0].frame.tolist() == whole.partings[0].frame.tolist()
    assert joined.select(slice(1, 2)).partings[0].frame.tolist() == [7]
    assert joined.weather.tolist() == whole.weather.tolist()


def test_each_of_several_is_held_against_the_first(run):
    near = moved(run, vehicle=1, frames=slice(7, None), s=5000, row=0)
    far = moved(run, vehicle=0, frames=slice(3, None), d=3000, row=2)
    found = compared(run, near, far)
    assert [one.frame.tolist() for one in found.partings] == [
        [7, TOGETHER, TOGETHER],
        [TOGETHER, TOGETHER, 3],
    ]
    values = comparison.values_of(found)
    assert values["same_class"] == 3
    assert [other["simulator"] for other in values["others"]] == ["sumo", "carla"]
    assert [row["partings"][1] for row in values["rows"]] == [
        None,
        None,
        {
            "time_s": 0.15,
            "vehicle": 0,
            "position_m": pytest.approx(run.states.s[2, 0, 3] / 1000),
            "along_m": 0.0,
            "left_m": 3.0,
        },
    ]


def test_groups_say_by_when_half_of_them_have_parted(run):
    there = moved(run, vehicle=1, frames=slice(7, None), s=5000, row=0)
    once = comparison.values_of(compared(run, there))
    assert [group["median_parting_s"] for group in once["by_class"]] == [[None]]
    twice = moved(there, vehicle=1, frames=slice(20, None), s=5000, row=1)
    (group,) = comparison.values_of(compared(run, twice))["by_class"]
    assert group == {
        "name": "No_attempt",
        "simulations": 3,
        "same_class": [3],
        "completed": [0, 0],
        "collisions": [0, 0],
        "median_parting_s": [1.0],
    }


def test_weather_is_named_by_preset_or_by_what_it_is():
    skies = [{"preset": 0.0}, {}, {"rain": 50.0}, {"night": 1.0}, {"fog": 95.0, "night": 1.0}]
    world = scenario(*[[Vehicle()]] * 5, weather=skies)
    first, *others = weather_names(world.weather).tolist()
    assert others == ["day, dry", "day, rain", "night, dry", "night, fog"]
    assert first.isidentifier()
