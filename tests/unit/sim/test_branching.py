"""Branches: rejected interventions, and effects from the frame of an intervention on."""

from __future__ import annotations

import json

import numpy as np
import pytest
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking.core.errors import ConfigError
from overtaking.model.driver_interface import Actions
from overtaking.model.scenario import Intervention
from overtaking.sim import engine, reference
from overtaking.sim.branching import ForcedDecision, branch


def lone_ego(**changes: float):
    alone = Vehicle(s=100.0, lane=1, speed=30.0, driver={"desired_speed": 30.0})
    return scenario([alone], road=wide_road(), **{"horizon": 10.0, **changes})


@pytest.mark.parametrize("frame", [-1, 201, 1_000_000])
def test_a_frame_beyond_all_simulations_is_rejected(frame: int):
    with pytest.raises(ConfigError, match=f"frame: expected 0 to 200, .*got {frame}"):
        branch(lone_ego(), frame)


def test_a_change_of_weather_takes_effect_from_its_frame_on():
    calm = lone_ego()
    gale = calm.weather.replace(
        wind=np.full(1, 80.0, np.float32), wind_direction=np.full(1, 1.57, np.float32)
    )
    undisturbed = engine.simulate(calm)
    recording = branch(calm, 60, weather=gale)
    before = slice(0, 60)
    np.testing.assert_array_equal(
        recording.states.d[0, 0, before], undisturbed.states.d[0, 0, before]
    )
    blown = recording.states.d[0, 0, 60:100] - undisturbed.states.d[0, 0, 60:100]
    assert blown.max() > 100  # mm, to the left, the leeward side.


@pytest.mark.ci
def test_engine_and_reference_give_equal_branches():
    branched = branch(lone_ego(), 20, decision=ForcedDecision.PULL_OUT)
    by_reference = branch(lone_ego(), 20, decision=ForcedDecision.PULL_OUT, run=reference.run)
    np.testing.assert_array_equal(branched.trace_hash, by_reference.trace_hash)


def test_a_branch_beyond_the_end_changes_nothing():
    short = lone_ego(attempt_deadline=5.0)
    undisturbed = engine.simulate(short)
    assert undisturbed.num_frames.tolist() == [101]
    np.testing.assert_array_equal(
        branch(short, 150, decision=ForcedDecision.PULL_OUT).trace_hash, undisturbed.trace_hash
    )


def traffic():
    """An ego, a slower leader, and a follower in the next lane."""
    cars = [
        Vehicle(s=100.0, lane=1, speed=30.0, driver={"desired_speed": 35.0}),
        Vehicle(s=160.0, lane=1, speed=22.0, driver={"desired_speed": 22.0}),
        Vehicle(s=40.0, lane=2, speed=33.0, driver={"desired_speed": 34.0}),
    ]
    return scenario(cars, road=wide_road(), horizon=15.0)


CHANGES = (
    Intervention(frame=20, decision=ForcedDecision.STAY),
    Intervention(frame=30, slot=1, speed_change=-4.0),
    Intervention(frame=50, decision=ForcedDecision.PULL_OUT),
    Intervention(frame=60, without=("rain",)),
    Intervention(frame=70, slot=2, position_change=-15.0),
    Intervention(frame=80, traits={"time_gap": 0.5}),
    Intervention(frame=120, slot=2, remove=True),
)


@pytest.mark.ci
def test_engine_and_reference_give_equal_branches_of_many_interventions():
    branched = branch(traffic(), interventions=CHANGES)
    by_reference = branch(traffic(), interventions=CHANGES, run=reference.run)
    np.testing.assert_array_equal(branched.trace_hash, by_reference.trace_hash)
    for name in branched.states.__slots__:
        np.testing.assert_array_equal(
            getattr(branched.states, name), getattr(by_reference.states, name)
        )


@pytest.mark.parametrize("cut", range(len(CHANGES) + 1))
def test_a_branch_of_a_branch_equals_a_branch_with_both_interventions(cut: int):
    first = branch(traffic(), interventions=CHANGES[:cut])
    in_two_parts = branch(first, interventions=CHANGES[cut:])
    at_once = branch(traffic(), interventions=CHANGES)
    np.testing.assert_array_equal(in_two_parts.trace_hash, at_once.trace_hash)
    assert in_two_parts.branch_origin is not None
    assert in_two_parts.branch_origin.interventions == CHANGES


def test_the_order_of_interventions_at_different_frames_makes_no_difference():
    reversed_order = branch(traffic(), interventions=CHANGES[::-1])
    np.testing.assert_array_equal(
        reversed_order.trace_hash, branch(traffic(), interventions=CHANGES).trace_hash
    )


@pytest.mark.parametrize("run", [engine.run, pytest.param(reference.run, marks=pytest.mark.ci)])
def test_a_branch_without_intervention_equals_the_simulation(run):
    branched = branch(
        traffic(), interventions=[Intervention(frame=17), Intervention(frame=40)], run=run
    )
    np.testing.assert_array_equal(branched.trace_hash, engine.simulate(traffic()).trace_hash)
    assert branched.branch_origin is None


def test_a_vehicle_is_moved_and_slowed_from_its_frame_on():
    before = engine.simulate(traffic()).states
    after = branch(
        traffic(),
        interventions=[Intervention(frame=40, slot=1, position_change=12.5, speed_change=-3.0)],
    ).states
    np.testing.assert_array_equal(after.s[0, :, :40], before.s[0, :, :40])
    assert after.s[0, 1, 40] - before.s[0, 1, 40] == 12_500
    assert after.speed[0, 1, 40] - before.speed[0, 1, 40] == -3_000
    assert after.s[0, 0, 40] == before.s[0, 0, 40]


def test_an_intervention_at_frame_0_changes_the_start():
    moved = traffic()
    start_s = moved.start_s.copy()
    start_s[0, 1] += np.float32(7.0)
    moved = moved.replace(start_s=start_s)
    branched = branch(traffic(), interventions=[Intervention(slot=1, position_change=7.0)])
    np.testing.assert_array_equal(branched.trace_hash, engine.simulate(moved).trace_hash)


def test_a_removed_vehicle_has_no_states_and_no_neighbours():
    run = branch(traffic(), interventions=[Intervention(frame=100, slot=1, remove=True)])
    assert run.state_mask[0, 1, :100].all()
    assert not run.state_mask[0, 1, 100:].any()
    assert not run.states.s[0, 1, 100:].any()
    alone = branch(traffic(), interventions=[Intervention(slot=1, remove=True)])
    assert not alone.state_mask[0, 1].any()
    # The slower leader keeps the ego below its desired speed; without it the ego reaches it.
    assert engine.simulate(traffic()).states.speed[0, 0, 250] < 30_000
    assert 34_000 < alone.states.speed[0, 0, 250] <= 35_000


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (Intervention(slot=5, remove=True), "vehicle: expected 0 to 2, got 5"),
        (Intervention(remove=True), "vehicle: expected another vehicle than the ego"),
        (Intervention(traits={"mood": 1.0}), "trait: expected .*desired_speed.*got mood"),
        (Intervention(without=("sun",)), "without: expected .*rain.*got sun"),
    ],
)
def test_an_impossible_intervention_is_rejected(change: Intervention, message: str):
    with pytest.raises(ConfigError, match=message):
        branch(traffic(), interventions=[change])


@pytest.mark.parametrize("change", [*CHANGES, Intervention(weather=traffic().weather.replace())])
def test_an_intervention_survives_json(change: Intervention):
    again = Intervention.from_dict(json.loads(json.dumps(change.to_dict())))
    assert again.to_dict() == change.to_dict()
    recording = [
        branch(traffic(), interventions=[intervention]).trace_hash
        for intervention in (change, again)
    ]
    np.testing.assert_array_equal(*recording)


def test_valid_interventions_that_are_invalid_together_are_rejected():
    slower, faster = Intervention(speed_change=-20.0), Intervention(speed_change=70.0)
    for changes in ((slower, slower), (faster, faster)):
        with pytest.raises(ConfigError, match=r"^branch: .*_speed: expected 0 to 150 m/s"):
            branch(lone_ego(), interventions=changes)  # From 30 m/s.
        with pytest.raises(ConfigError, match=r"^branch: .*_speed: expected 0 to 150 m/s"):
            branch(branch(lone_ego(), interventions=changes[:1]), interventions=changes[1:])
    later = Intervention(frame=50, speed_change=70.0)
    with pytest.raises(ConfigError, match=r"^branch: .*_speed: expected 0 to 150 m/s"):
        branch(lone_ego(), interventions=(faster, later))


def test_interventions_at_one_frame_are_checked_by_their_common_result():
    changes = (Intervention(speed_change=-40.0), Intervention(speed_change=30.0))
    assert branch(lone_ego(), interventions=changes).scenario.start_speed[0, 0] == 20.0


def test_a_simulation_of_an_external_driver_is_not_branched():
    driven = engine.simulate(traffic()).replace(actions=Actions.empty(1))
    with pytest.raises(ConfigError, match="expected one in which the model drives the ego"):
        branch(driven, 3)
