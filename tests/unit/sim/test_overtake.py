"""The ego's overtakes as stories: what it does where, told by the engine and checked by hand."""

from __future__ import annotations

import dataclasses
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.minds import CLEAR_MINDED, Moment, moment
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
"""A driver who overtakes whoever is slower."""


def ego(speed: float = 30.0, lane: int = 0, **driver: float) -> Vehicle:
    return Vehicle(s=100.0, lane=lane, speed=speed, driver=EAGER | driver)


def other(s: float, lane: int, speed: float) -> Vehicle:
    return Vehicle(s=100.0 + s, lane=lane, speed=speed, driver={"desired_speed": speed})


def told(*vehicles: Vehicle, horizon: float = 40.0, road: Road | None = None, **options):
    world = scenario(list(vehicles), road=road or wide_road(), horizon=horizon, **options)
    return engine.run(world, step_parameters(world, CLEAR_MINDED))


def stages(ran: Trajectories) -> list[Stage]:
    """The stages in their order, each once."""
    row = ran.stage[0, : ran.num_frames[0]]
    return [Stage(row[0]), *[Stage(b) for a, b in pairwise(row) if a != b]]


def first(ran: Trajectories, stage: Stage) -> int:
    """First frame of a stage."""
    return int(np.argmax(ran.stage[0] == stage))


def test_a_slow_leader_on_an_empty_road_is_overtaken_and_the_ego_returns():
    ran = told(ego(), other(80.0, 0, 20.0))
    assert stages(ran) == [Stage.FOLLOW, Stage.PULL_OUT, Stage.PASS, Stage.RETURN, Stage.DONE]
    end = int(ran.num_frames[0]) - 1
    assert ran.states.s[0, 0, end] > ran.states.s[0, 1, end]
    assert ran.states.lane[0, 0, end] == 0
    assert (ran.contacts.partner == 255).all()


def test_it_passes_in_the_next_lane_and_returns_with_room():
    ran = told(ego(return_time_gap=1.5), other(80.0, 0, 20.0))
    s, lane = ran.states.s[0] / 1000.0, ran.states.lane[0, 0]
    beside = np.abs(s[0] - s[1]) < CAR
    assert (lane[: ran.num_frames[0]][beside[: ran.num_frames[0]]] == 1).all()
    back = first(ran, Stage.RETURN)
    # 1.5 s of the other's speed behind the bumper when the line is crossed, after half of the 5 s.
    assert s[0, back + 50] - s[1, back + 50] - CAR >= 1.5 * 20.0 - 0.5


def test_it_signals_before_it_moves_and_the_other_way_to_return():
    ran = told(ego(indicator_lead_time=1.5), other(80.0, 0, 20.0))
    lights = ran.states.lights[0, 0].astype(int)
    out, back = first(ran, Stage.PULL_OUT), first(ran, Stage.RETURN)
    left, right = Lights.INDICATOR_LEFT, Lights.INDICATOR_RIGHT
    for until, light in ((out, left), (back, right)):
        assert (lights[until - 29 : until] & light == light).all()  # 1.5 s are 30 decisions.
        assert not lights[until - 33] & light  # It looks once more before it moves.
    assert not (lights[out:back] & right)[: back - out - 31].any()
    assert not lights[ran.num_frames[0] - 1] & (left | right)


def test_who_never_signals_never_shows_a_light():
    ran = told(ego(uses_indicator=0.0), other(80.0, 0, 20.0))
    assert Stage.DONE in stages(ran)
    assert not (ran.states.lights[0, 0] & 3).any()


@pytest.mark.parametrize("leader", [29.5, 33.0])
def test_who_is_hardly_slower_is_followed(leader: float):
    ran = told(ego(desired_speed=30.0), other(60.0, 0, leader), horizon=20.0)
    assert stages(ran) == [Stage.FOLLOW]


def test_on_the_fastest_lane_there_is_no_overtaking():
    ran = told(ego(lane=2), other(80.0, 2, 20.0), horizon=20.0)
    assert stages(ran) == [Stage.FOLLOW]


def test_it_waits_while_the_next_lane_is_taken_and_goes_once_it_is_free():
    # A convoy at 28 m/s passes in the next lane; the leader drives 20 m/s.
    convoy = [other(20.0 - 30.0 * k, 1, 28.0) for k in range(5)]
    ran = told(ego(speed=22.0), other(60.0, 0, 20.0), *convoy)
    out = first(ran, Stage.PULL_OUT)
    assert Stage.DONE in stages(ran)
    s = ran.states.s[0] / 1000.0
    # The last of the convoy is past, or so far behind that it need not brake hard.
    apart = s[2:7, out] - s[0, out]
    behind = apart[apart < 0.0]
    assert out * 0.05 > 3.0
    assert (behind < -15.0).all()
    assert (ran.contacts.partner == 255).all()


def test_impatience_takes_smaller_gaps():
    # Cars at 26 m/s every 56 m in the next lane: too dense for one who asks for twice the usual.
    convoy = [other(10.0 - 56.0 * k, 1, 26.0) for k in range(6)]
    leader = other(40.0, 0, 20.0)
    patient, impatient = (
        told(ego(speed=21.0, patience=patience, gap_demand_factor=2.0), leader, *convoy)
        for patience in (1e4, 2.0)
    )
    # All six are past after a minute at 5 m/s more; patience of 2 s does not last for them.
    assert first(impatient, Stage.PULL_OUT) * 0.05 < 10.0
    assert not (patient.stage[0, :300] == Stage.PULL_OUT).any()


def test_a_danger_that_comes_up_behind_makes_it_give_up_early():
    # A car at 48 m/s, out of sight of the mirror (150 m) when the ego sets out, and an ego that
    # takes its time and does not want to be the reason for braking.
    racer = other(-205.0, 1, 48.0)
    timid = ego(speed=22.0, indicator_lead_time=0.1, lane_change_duration=9.0, safe_decel=2.0)
    world = scenario([timid, other(30.0, 0, 20.0), racer], road=wide_road(), horizon=30.0)
    ran = engine.run(world, step_parameters(world, dataclasses.replace(CLEAR_MINDED, range=True)))
    assert stages(ran)[:3] == [Stage.FOLLOW, Stage.PULL_OUT, Stage.ABORT]
    given_up = first(ran, Stage.ABORT)
    # Before half of the way, and then back to the lane that it came from.
    assert given_up - first(ran, Stage.PULL_OUT) <= 90
    assert ran.states.lane[0, 0, given_up + 150] == 0
    assert (ran.contacts.partner == 255).all()


def test_the_deadline_ends_a_simulation_without_an_attempt():
    ran = told(ego(desired_speed=20.0), other(60.0, 0, 25.0), attempt_deadline=8.0)
    assert int(ran.num_frames[0]) == 161
    assert stages(ran) == [Stage.FOLLOW]


def test_three_seconds_after_the_overtake_the_simulation_ends():
    ran = told(ego(), other(80.0, 0, 20.0))
    done = first(ran, Stage.DONE)
    assert int(ran.num_frames[0]) - 1 - done in (59, 60)


def test_what_it_believed_is_written_down_at_each_decision():
    ran = told(ego(), other(80.0, 0, 20.0), other(-60.0, 1, 25.0))
    b = ran.percepts
    kinds = [ManoeuvreKind(k) for k in b.kind[0][b.valid[0]]]
    assert kinds == [ManoeuvreKind.PULL_OUT, ManoeuvreKind.RETURN]
    out = int(b.time[0, 0]) // 50
    s, speed = ran.states.s[0, :, out] / 1000.0, ran.states.speed[0, :, out] / 1000.0
    # Leader: slot 1; nobody ahead in the next lane; slot 2 behind there.
    np.testing.assert_array_equal(b.slot[0, 0], [1, 255, 2])
    np.testing.assert_array_equal(b.is_detected[0, 0], [True, False, True])
    assert b.true_gap[0, 0, 0] / 1000.0 == pytest.approx(s[1] - s[0] - CAR, abs=2e-3)
    assert b.true_gap[0, 0, 2] / 1000.0 == pytest.approx(s[0] - s[2] - CAR, abs=2e-3)
    assert b.true_closing_speed[0, 0, 0] / 1000.0 == pytest.approx(speed[0] - speed[1], abs=2e-3)
    # A clear mind believes what is.
    np.testing.assert_allclose(b.gap[0, 0, [0, 2]], b.true_gap[0, 0, [0, 2]], atol=2)
    np.testing.assert_allclose(
        b.closing_speed[0, 0, [0, 2]], b.true_closing_speed[0, 0, [0, 2]], atol=2
    )


def view_of(*vehicles: Vehicle) -> tuple[Moment, gap_acceptance.GapAcceptanceInputs]:
    """What the ego knows at one moment."""
    m = moment(list(vehicles))
    return m, gap_acceptance.gap_acceptance_inputs(m.state, m.given, m.context(), EGO_SLOT)


@pytest.mark.parametrize(
    ("front", "behind", "allowed"),
    [
        (None, None, True),
        (other(60.0, 0, 30.0), None, True),
        (other(8.0, 0, 22.0), None, False),  # It would have to brake hard at once.
        (other(5.5, 0, 30.5), None, False),  # On the bumper, faster or not.
        (other(60.0, 0, 22.0), None, False),  # It would have to pull out again within 8 s.
        (None, other(-40.0, 0, 20.0), True),
        (None, other(-20.0, 0, 20.0), True),  # 16 m, and 25 m more until the line is crossed.
        (None, other(-20.0, 0, 29.0), False),  # Hardly more: less than the second that it leaves.
        (None, other(-45.0, 0, 48.0), False),  # It would be braked for.
    ],
)
def test_it_returns_only_where_there_is_room_ahead_and_behind(front, behind, allowed: bool):
    around = [one for one in (front, behind) if one is not None]
    m, view = view_of(ego(lane=1), *around)
    assert bool(gap_acceptance.accepts_return_gaps(m.given, view)[0]) is allowed


@pytest.mark.parametrize(
    ("around", "allowed"),
    [
        ((), True),
        ((other(-36.0, 1, 30.0),), True),
        ((other(-28.0, 1, 30.0),), False),  # It would brake hard if it sped up a little.
        ((other(-5.0, 1, 30.0),), False),  # Beside its own bumper.
        ((other(-30.0, 1, 48.0),), False),
        ((other(12.0, 1, 20.0),), False),  # No faster there, and near.
        ((other(150.0, 1, 29.0),), True),
    ],
)
def test_it_pulls_out_only_where_there_is_room_and_a_gain(around, allowed: bool):
    m, view = view_of(ego(), other(40.0, 0, 20.0), *around)
    assert bool(gap_acceptance.accepts_pull_out_gaps(m.given, view)[0]) is allowed


def test_the_longest_wait_does_not_ask_more_of_others_than_an_emergency_does():
    # Demanding a tenth of the gap alone, it would let the other brake by 40 m/s^2.
    m, view = view_of(ego(gap_demand_factor=0.1, safe_decel=4.0))
    assert float(view.gap_factor[0]) == pytest.approx(0.1, rel=1e-5)
    assert float(view.acceptable_imposed_decel[0]) == pytest.approx(6.0)
    assert float(m.given.constants.max_imposed_decel) == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("distance", "leader", "wanted"),
    [
        (40.0, 20.0, True),  # Close: 36 m are under 1.5 times its time gap.
        (62.0, 20.0, True),  # Six seconds before it would touch.
        (70.0, 20.0, False),  # Not yet.
        (40.0, 32.5, False),  # Not slower by what makes it worth it.
    ],
)
def test_it_wants_to_pass_whoever_is_slow_and_near(distance: float, leader: float, wanted: bool):
    m, view = view_of(ego(), other(distance, 0, leader))
    assert bool(gap_acceptance.wants_to_overtake(m.given, view)[0]) is wanted


def branched(decision: ForcedDecision, seconds: float, *vehicles: Vehicle) -> Trajectories:
    world = scenario(list(vehicles), road=wide_road(), horizon=40.0)
    return branch(world, round(seconds * 20.0), decision=decision)


STORY = (ego(), other(80.0, 0, 20.0))


def test_a_branch_can_forbid_the_overtake():
    assert stages(branched(ForcedDecision.STAY, 0.0, *STORY)) == [Stage.FOLLOW]


def test_a_branch_can_force_it_on_who_does_not_want_to():
    content = (ego(min_speed_gain=1e6), other(80.0, 0, 25.0))
    ran = branched(ForcedDecision.PULL_OUT, 2.0, *content)
    # It takes effect at the first instant that allows it, after the indicator has been on.
    assert first(ran, Stage.PULL_OUT) * 0.05 == pytest.approx(3.0, abs=0.11)


def test_a_branch_can_make_it_give_up():
    undisturbed = engine.simulate(scenario(list(STORY), road=wide_road(), horizon=40.0))
    out = first(undisturbed, Stage.PULL_OUT)
    ran = branched(ForcedDecision.CANCEL, out * 0.05 + 0.5, *STORY)
    assert stages(ran)[:3] == [Stage.FOLLOW, Stage.PULL_OUT, Stage.ABORT]
    assert ran.states.lane[0, 0, out + 200] == 0


@pytest.mark.parametrize(("signals", "partner"), [(0.0, 1), (1.0, 255)])
def test_a_branch_can_force_the_return_into_the_other_who_makes_room_only_if_warned(
    signals: float, partner: int
):
    # A lorry that is 1.5 m/s faster by its governor: beside the other for many seconds.
    slow = ego(
        speed=25.0,
        min_speed_gain=0.1,
        pull_out_ttc=60.0,
        uses_indicator=signals,
        lane_change_duration=4.0,
    )
    lorry = dataclasses.replace(slow, body={"max_speed": 25.0})
    story = (lorry, other(25.0, 0, 23.5))
    undisturbed = engine.simulate(scenario(list(story), road=wide_road(), horizon=40.0))
    s = undisturbed.states.s[0]
    beside = int(np.argmin(np.abs(s[0] - s[1])[: undisturbed.num_frames[0]]))
    assert undisturbed.stage[0, beside] == Stage.PASS
    ran = branched(ForcedDecision.RETURN, beside * 0.05 - 1.0, *story)
    assert ran.contacts.partner[0, 0] == partner
    assert (stages(ran)[-1] == Stage.CRASHED) is (partner == 1)
