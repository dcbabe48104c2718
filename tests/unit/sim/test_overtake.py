"""Overtakes of the ego in simulations of the engine, with stages and positions checked by hand."""

from __future__ import annotations

import dataclasses
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.traffic_instant import PERFECT_PERCEPTION, TrafficInstant, traffic_instant
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking.sim.reference import gap_acceptance

if TYPE_CHECKING:
    from overtaking.model.road import Road

from overtaking.model.trajectories import Lights, ManoeuvreKind, Stage, Trajectories
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim import engine
from overtaking.sim.branching import ForcedDecision, branch
from overtaking.world.step_parameters import step_parameters

CAR = 4.4

EAGER = {
    "desired_speed": 33.0, "min_speed_gain": 1.0, "patience": 1000.0, "pull_out_ttc": 6.0,
    "gap_demand_factor": 1.0, "return_time_gap": 1.0, "indicator_lead_time": 1.0,
}  # fmt: skip
"""Traits of a driver that overtakes every slower vehicle."""


def ego(speed: float = 30.0, lane: int = 0, **driver: float) -> Vehicle:
    """The ego at 100 m, by default an eager driver at 30 m/s in the slowest lane."""
    return Vehicle(s=100.0, lane=lane, speed=speed, driver=EAGER | driver)


def vehicle_at(s: float, lane: int, speed: float) -> Vehicle:
    """Another vehicle at a distance from the ego, which keeps its speed."""
    return Vehicle(s=100.0 + s, lane=lane, speed=speed, driver={"desired_speed": speed})


def run_engine(*vehicles: Vehicle, horizon: float = 40.0, road: Road | None = None, **options):
    world = scenario(list(vehicles), road=road or wide_road(), horizon=horizon, **options)
    return engine.run(world, step_parameters(world, PERFECT_PERCEPTION))


def stages(recording: Trajectories) -> list[Stage]:
    """The stages of the ego in order."""
    row = recording.stage[0, : recording.num_frames[0]]
    return [Stage(row[0]), *[Stage(new) for old, new in pairwise(row) if old != new]]


def first_frame(recording: Trajectories, stage: Stage) -> int:
    """First frame of a stage."""
    return int(np.argmax(recording.stage[0] == stage))


def test_a_slow_leader_on_an_empty_road_is_overtaken_and_the_ego_returns():
    recording = run_engine(ego(), vehicle_at(80.0, 0, 20.0))
    assert stages(recording) == [Stage.FOLLOW, Stage.PULL_OUT, Stage.PASS, Stage.RETURN, Stage.DONE]
    end = int(recording.num_frames[0]) - 1
    assert recording.states.s[0, 0, end] > recording.states.s[0, 1, end]
    assert recording.states.lane[0, 0, end] == 0
    assert (recording.contacts.partner == 255).all()


def test_the_ego_passes_in_the_next_lane_and_returns_with_a_gap():
    recording = run_engine(ego(return_time_gap=1.5), vehicle_at(80.0, 0, 20.0))
    s, lane = recording.states.s[0] / 1000.0, recording.states.lane[0, 0]
    beside = np.abs(s[0] - s[1]) < CAR
    assert (lane[: recording.num_frames[0]][beside[: recording.num_frames[0]]] == 1).all()
    back = first_frame(recording, Stage.RETURN)
    # The follower has a time gap of 1.5 s when the ego crosses the line, after half of the 5 s.
    assert s[0, back + 50] - s[1, back + 50] - CAR >= 1.5 * 20.0 - 0.5


def test_the_ego_indicates_before_it_pulls_out_and_before_it_returns():
    recording = run_engine(ego(indicator_lead_time=1.5), vehicle_at(80.0, 0, 20.0))
    lights = recording.states.lights[0, 0].astype(int)
    out, back = first_frame(recording, Stage.PULL_OUT), first_frame(recording, Stage.RETURN)
    left, right = Lights.INDICATOR_LEFT, Lights.INDICATOR_RIGHT
    for until, light in ((out, left), (back, right)):
        assert (lights[until - 29 : until] & light == light).all()  # 1.5 s are 30 decisions.
        assert (
            not lights[until - 33] & light
        )  # The ego checks its mirrors once more before it moves.
    assert not (lights[out:back] & right)[: back - out - 31].any()
    assert not lights[recording.num_frames[0] - 1] & (left | right)


def test_a_driver_without_indicator_shows_none():
    recording = run_engine(ego(uses_indicator=0.0), vehicle_at(80.0, 0, 20.0))
    assert Stage.DONE in stages(recording)
    assert not (recording.states.lights[0, 0] & 3).any()


@pytest.mark.parametrize("leader", [29.5, 33.0])
def test_a_leader_that_is_hardly_slower_is_followed(leader: float):
    recording = run_engine(ego(desired_speed=30.0), vehicle_at(60.0, 0, leader), horizon=20.0)
    assert stages(recording) == [Stage.FOLLOW]


def test_on_the_fastest_lane_there_is_no_overtaking():
    recording = run_engine(ego(lane=2), vehicle_at(80.0, 2, 20.0), horizon=20.0)
    assert stages(recording) == [Stage.FOLLOW]


def test_the_ego_waits_while_the_next_lane_is_occupied():
    # A convoy at 28 m/s passes in the next lane; the leader drives 20 m/s.
    convoy = [vehicle_at(20.0 - 30.0 * k, 1, 28.0) for k in range(5)]
    recording = run_engine(ego(speed=22.0), vehicle_at(60.0, 0, 20.0), *convoy)
    out = first_frame(recording, Stage.PULL_OUT)
    assert Stage.DONE in stages(recording)
    s = recording.states.s[0] / 1000.0
    # The last of the convoy is past, or so far behind that it need not brake hard.
    distance = s[2:7, out] - s[0, out]
    behind = distance[distance < 0.0]
    assert out * 0.05 > 3.0
    assert (behind < -15.0).all()
    assert (recording.contacts.partner == 255).all()


def test_impatient_drivers_accept_smaller_gaps():
    # Cars at 26 m/s every 56 m in the next lane: too dense for twice the usual demand.
    convoy = [vehicle_at(10.0 - 56.0 * k, 1, 26.0) for k in range(6)]
    leader = vehicle_at(40.0, 0, 20.0)
    patient, impatient = (
        run_engine(ego(speed=21.0, patience=patience, gap_demand_factor=2.0), leader, *convoy)
        for patience in (1e4, 2.0)
    )
    # All six are past after a minute at 5 m/s more; patience of 2 s does not last for them.
    assert first_frame(impatient, Stage.PULL_OUT) * 0.05 < 10.0
    assert not (patient.stage[0, :300] == Stage.PULL_OUT).any()


def test_a_fast_vehicle_behind_makes_the_ego_abort_early():
    # A car at 48 m/s, beyond the range of the mirror (150 m) at the pull-out, and an ego with
    # a long lane change that imposes little braking.
    racer = vehicle_at(-205.0, 1, 48.0)
    timid = ego(speed=22.0, indicator_lead_time=0.1, lane_change_duration=9.0, safe_decel=2.0)
    world = scenario([timid, vehicle_at(30.0, 0, 20.0), racer], road=wide_road(), horizon=30.0)
    recording = engine.run(
        world, step_parameters(world, dataclasses.replace(PERFECT_PERCEPTION, range=True))
    )
    assert stages(recording)[:3] == [Stage.FOLLOW, Stage.PULL_OUT, Stage.ABORT]
    given_up = first_frame(recording, Stage.ABORT)
    # In the first half of the lane change, and then back to the old lane.
    assert given_up - first_frame(recording, Stage.PULL_OUT) <= 90
    assert recording.states.lane[0, 0, given_up + 150] == 0
    assert (recording.contacts.partner == 255).all()


def test_the_deadline_ends_a_simulation_without_an_attempt():
    recording = run_engine(ego(desired_speed=20.0), vehicle_at(60.0, 0, 25.0), attempt_deadline=8.0)
    assert int(recording.num_frames[0]) == 161
    assert stages(recording) == [Stage.FOLLOW]


def test_three_seconds_after_the_overtake_the_simulation_ends():
    recording = run_engine(ego(), vehicle_at(80.0, 0, 20.0))
    done_frame = first_frame(recording, Stage.DONE)
    assert int(recording.num_frames[0]) - 1 - done_frame in (59, 60)


def test_beliefs_are_recorded_at_each_manoeuvre():
    recording = run_engine(ego(), vehicle_at(80.0, 0, 20.0), vehicle_at(-60.0, 1, 25.0))
    percepts = recording.percepts
    kinds = [ManoeuvreKind(k) for k in percepts.kind[0][percepts.valid[0]]]
    assert kinds == [ManoeuvreKind.PULL_OUT, ManoeuvreKind.RETURN]
    out = int(percepts.time[0, 0]) // 50
    s, speed = recording.states.s[0, :, out] / 1000.0, recording.states.speed[0, :, out] / 1000.0
    # Leader: slot 1; no new leader; new follower: slot 2.
    np.testing.assert_array_equal(percepts.slot[0, 0], [1, 255, 2])
    np.testing.assert_array_equal(percepts.is_detected[0, 0], [True, False, True])
    assert percepts.true_gap[0, 0, 0] / 1000.0 == pytest.approx(s[1] - s[0] - CAR, abs=2e-3)
    assert percepts.true_gap[0, 0, 2] / 1000.0 == pytest.approx(s[0] - s[2] - CAR, abs=2e-3)
    assert percepts.true_closing_speed[0, 0, 0] / 1000.0 == pytest.approx(
        speed[0] - speed[1], abs=2e-3
    )
    # With perfect perception the beliefs are true.
    np.testing.assert_allclose(percepts.gap[0, 0, [0, 2]], percepts.true_gap[0, 0, [0, 2]], atol=2)
    np.testing.assert_allclose(
        percepts.closing_speed[0, 0, [0, 2]], percepts.true_closing_speed[0, 0, [0, 2]], atol=2
    )


def gap_inputs(*vehicles: Vehicle) -> tuple[TrafficInstant, gap_acceptance.GapAcceptanceInputs]:
    """The ego's inputs of gap acceptance at one decision."""
    instant = traffic_instant(list(vehicles))
    return instant, gap_acceptance.gap_acceptance_inputs(
        instant.state, instant.params, instant.context(), EGO_SLOT
    )


@pytest.mark.parametrize(
    ("front", "behind", "allowed"),
    [
        (None, None, True),
        (vehicle_at(60.0, 0, 30.0), None, True),
        (vehicle_at(8.0, 0, 22.0), None, False),  # It would have to brake hard at once.
        (vehicle_at(5.5, 0, 30.5), None, False),  # Too close, although the leader is faster.
        (vehicle_at(60.0, 0, 22.0), None, False),  # It would have to pull out again within 8 s.
        (None, vehicle_at(-40.0, 0, 20.0), True),
        (None, vehicle_at(-20.0, 0, 20.0), True),  # 16 m, and 25 m more until the line is crossed.
        (
            None,
            vehicle_at(-20.0, 0, 29.0),
            False,
        ),  # Hardly more than 16 m: less than a time gap of 1 s.
        (None, vehicle_at(-45.0, 0, 48.0), False),  # The follower would have to brake hard.
    ],
)
def test_the_ego_returns_only_into_gaps_ahead_and_behind(front, behind, allowed: bool):
    neighbours = [vehicle for vehicle in (front, behind) if vehicle is not None]
    instant, inputs = gap_inputs(ego(lane=1), *neighbours)
    assert bool(gap_acceptance.accepts_return_gaps(instant.params, inputs)[0]) is allowed


@pytest.mark.parametrize(
    ("neighbours", "allowed"),
    [
        ((), True),
        ((vehicle_at(-36.0, 1, 30.0),), True),
        (
            (vehicle_at(-28.0, 1, 30.0),),
            False,
        ),  # After accelerating a little it would have to brake hard.
        ((vehicle_at(-5.0, 1, 30.0),), False),  # Alongside.
        ((vehicle_at(-30.0, 1, 48.0),), False),
        ((vehicle_at(12.0, 1, 20.0),), False),  # Near, and no faster than the present leader.
        ((vehicle_at(150.0, 1, 29.0),), True),
    ],
)
def test_the_ego_pulls_out_only_with_a_gap_and_a_gain_of_speed(neighbours, allowed: bool):
    instant, inputs = gap_inputs(ego(), vehicle_at(40.0, 0, 20.0), *neighbours)
    assert bool(gap_acceptance.accepts_pull_out_gaps(instant.params, inputs)[0]) is allowed


def test_waiting_never_imposes_more_braking_than_the_limit():
    # Without the limit, a tenth of the usual demand would allow an imposed braking of 40 m/s^2.
    instant, inputs = gap_inputs(ego(gap_demand_factor=0.1, safe_decel=4.0))
    assert float(inputs.gap_factor[0]) == pytest.approx(0.1, rel=1e-5)
    assert float(inputs.acceptable_imposed_decel[0]) == pytest.approx(6.0)
    assert float(instant.params.constants.max_imposed_decel) == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("distance", "leader", "wants_to_overtake"),
    [
        (40.0, 20.0, True),  # Close: 36 m are under 1.5 times its time gap.
        (62.0, 20.0, True),  # The time to collision is just below 6 s.
        (70.0, 20.0, False),  # The time to collision is still above 6 s.
        (40.0, 32.5, False),  # The gain of speed is too small.
    ],
)
def test_the_ego_wants_to_overtake_a_slow_and_near_leader(
    distance: float, leader: float, wants_to_overtake: bool
):
    instant, inputs = gap_inputs(ego(), vehicle_at(distance, 0, leader))
    assert bool(gap_acceptance.wants_to_overtake(instant.params, inputs)[0]) is wants_to_overtake


def branched(decision: ForcedDecision, seconds: float, *vehicles: Vehicle) -> Trajectories:
    world = scenario(list(vehicles), road=wide_road(), horizon=40.0)
    return branch(world, round(seconds * 20.0), decision=decision)


STORY = (ego(), vehicle_at(80.0, 0, 20.0))


def test_a_branch_can_forbid_the_overtake():
    assert stages(branched(ForcedDecision.STAY, 0.0, *STORY)) == [Stage.FOLLOW]


def test_a_branch_can_force_the_overtake():
    content = (ego(min_speed_gain=1e6), vehicle_at(80.0, 0, 25.0))
    recording = branched(ForcedDecision.PULL_OUT, 2.0, *content)
    # It takes effect at the first instant that allows it, after the indicator has been on.
    assert first_frame(recording, Stage.PULL_OUT) * 0.05 == pytest.approx(3.0, abs=0.11)


def test_a_branch_can_force_an_abort():
    undisturbed = engine.simulate(scenario(list(STORY), road=wide_road(), horizon=40.0))
    out = first_frame(undisturbed, Stage.PULL_OUT)
    recording = branched(ForcedDecision.CANCEL, out * 0.05 + 0.5, *STORY)
    assert stages(recording)[:3] == [Stage.FOLLOW, Stage.PULL_OUT, Stage.ABORT]
    assert recording.states.lane[0, 0, out + 200] == 0


@pytest.mark.parametrize(("signals", "partner"), [(0.0, 1), (1.0, 255)])
def test_a_branch_can_force_a_return_into_a_follower_that_brakes_only_for_an_indicator(
    signals: float, partner: int
):
    # The governor leaves the ego 1.5 m/s faster than its target: they are alongside for seconds.
    slow = ego(
        speed=25.0,
        min_speed_gain=0.1,
        pull_out_ttc=60.0,
        uses_indicator=signals,
        lane_change_duration=4.0,
    )
    lorry = dataclasses.replace(slow, body={"max_speed": 25.0})
    story = (lorry, vehicle_at(25.0, 0, 23.5))
    undisturbed = engine.simulate(scenario(list(story), road=wide_road(), horizon=40.0))
    s = undisturbed.states.s[0]
    beside = int(np.argmin(np.abs(s[0] - s[1])[: undisturbed.num_frames[0]]))
    assert undisturbed.stage[0, beside] == Stage.PASS
    recording = branched(ForcedDecision.RETURN, beside * 0.05 - 1.0, *story)
    assert recording.contacts.partner[0, 0] == partner
    assert (stages(recording)[-1] == Stage.CRASHED) is (partner == 1)
