"""What is counted of passes in recordings that are known by construction."""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import numpy as np
import pytest
import scipy.optimize
import scipy.stats
from tests.support.worlds import Vehicle, scenario

from overtaking.analysis.validation import passes
from overtaking.analysis.validation.figures import HEAD_ON, PASSES
from overtaking.analysis.validation.tally import GROUPS, Tally
from overtaking.analysis.validation.traffic import Batch
from overtaking.model.known_roads import known_road
from overtaking.model.road_course import RoadCourse, SpeedLimitSpan
from overtaking.model.trajectories import Stage, Trajectories
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.scenarios.two_way_traffic import flows_per_second
from overtaking.sim import engine
from overtaking.world.step_parameters import step_parameters

OUT, BACK = 3.0, 11.0
EGO, LEADER, COMES = 25.0, 20.0, 25.0
BY_NAME = {one.name: one for one in (*PASSES, HEAD_ON)}


@cache
def driven() -> Trajectories:
    """An ego that is told to pass a truck, and does; somebody comes."""
    told = {"gap_demand_factor": 0.0, "desired_speed": 30.0, "min_speed_gain": 1.0}
    vehicles = [
        Vehicle(s=1000.0, speed=EGO, driver=told),
        Vehicle(kind="T", s=1050.0, speed=LEADER, driver={"desired_speed": LEADER}),
        Vehicle(kind="MC", s=2500.0, lane=1, speed=COMES, driver={"desired_speed": COMES}),
    ]
    world = scenario(vehicles, road=known_road("rural").extend_to(8000.0), horizon=20.0)
    return engine.run(world, step_parameters(world))


def made(comes_from: float = 2500.0) -> Trajectories:
    """The same with steady speeds, and with the ego in the other lane from `OUT` to `BACK`."""
    runs = driven()
    t = 0.05 * np.arange(runs.states.s.shape[2])
    away = (t >= OUT) & (t <= BACK)
    s, d, speed, lane = (getattr(runs.states, name).copy() for name in ("s", "d", "speed", "lane"))
    ways = (1000.0 + EGO * t, 1040.0 + LEADER * t, comes_from - COMES * t)
    for slot, (way, pace) in enumerate(zip(ways, (EGO, LEADER, COMES), strict=True)):
        s[0, slot], speed[0, slot] = np.rint(1e3 * way), 1e3 * pace
    d[0, 0], lane[0, 0] = np.where(away, 1750, -1750), away
    stages = [Stage.FOLLOW, Stage.PULL_OUT, Stage.PASS, Stage.RETURN, Stage.DONE]
    stage = np.array(stages, runs.stage.dtype)[np.searchsorted([2.5, 5.0, 10.0, 12.0], t, "right")]
    return runs.replace(
        states=runs.states.replace(s=s, d=d, speed=speed, lane=lane), stage=stage[None]
    )


def counted(runs: Trajectories) -> Tally:
    tally = Tally()
    passes.count(tally, Batch.of(runs))
    return tally


def test_a_pass_is_timed_from_when_the_line_is_crossed_until_the_ego_is_back():
    (one,) = passes.passes(made())
    lengths = driven().scenario.vehicles.length[0]
    assert one.duration == pytest.approx(BACK - OUT)
    assert one.way == pytest.approx(EGO * (BACK - OUT))
    assert one.surplus == pytest.approx(EGO - LEADER)
    assert one.passed_speed == pytest.approx(LEADER)
    committed = 8.0 - 0.5 * float(lengths[1]) / (EGO - LEADER)
    assert one.no_return == pytest.approx((committed - OUT) / (BACK - OUT), abs=0.01)
    assert one.is_truck
    bumpers = (EGO - LEADER) * BACK - 40.0 - 0.5 * float(lengths[0] + lengths[1])
    assert one.left == pytest.approx(bumpers / LEADER, abs=1e-3)
    apart = 1500.0 - (EGO + COMES) * BACK - 0.5 * float(lengths[0] + lengths[2])
    assert one.margin == pytest.approx(apart / (EGO + COMES), abs=1e-3)
    assert one.away == pytest.approx(apart + (EGO + COMES) * (BACK - 2.5), abs=1e-3)
    assert one.offered == pytest.approx(one.margin + BACK - 2.5, abs=1e-3)
    assert one.their_speed == COMES
    assert one.same
    # The line may be crossed from 810 to 1,606 m; the ego decides at 1,062.5 m.
    assert one.zone == pytest.approx(796.0)
    assert one.too_fast == (known_road("rural").speed_limit < EGO)


@pytest.mark.parametrize(
    ("start", "direction", "too_fast"), [(1270.0, 1, True), (1280.0, 1, False), (1100.0, -1, False)]
)
def test_a_pass_is_too_fast_by_the_limit_of_its_place(start: float, direction: int, too_fast: bool):
    lower = SpeedLimitSpan(start=start, stop=1400.0, speed=20.0, direction=direction)
    runs = made()
    assert not runs.road.course or not runs.road.course.speed_limit_spans
    road = dataclasses.replace(
        runs.road,
        course=dataclasses.replace(runs.road.course or RoadCourse(), speed_limit_spans=(lower,)),
    )
    (one,) = passes.passes(runs.replace(scenario=runs.scenario.replace(road=road)))
    assert one.too_fast == too_fast


@pytest.mark.parametrize(
    ("margin", "unsafe", "scarce"), [(5.0, 0.0, 0.0), (2.0, 1.0, 0.0), (0.5, 1.0, 1.0)]
)
def test_margins_are_counted_by_their_limits(margin, unsafe, scarce):
    lengths = driven().scenario.vehicles.length[0]
    from_there = 1000.0 + (EGO + COMES) * (BACK + margin) + 0.5 * float(lengths[0] + lengths[2])
    tally = counted(made(from_there))
    assert passes.mean_of(tally, "unsafe") == unsafe
    assert passes.mean_of(tally, "scarce") == scarce
    assert tally.total("offers_unsafe").sum() == unsafe
    assert passes.mean_of(tally, "duration") == pytest.approx(BACK - OUT)


def test_a_pass_without_an_oncomer_has_no_margin():
    tally = counted(made(6000.0))
    assert math.isnan(passes.mean_of(tally, "unsafe"))
    assert tally.total("duration_number")[0] == 1.0


def test_gaps_are_refused_once_a_second_while_held_up():
    tally = counted(made())
    # Within 3 s of the leader all the time; the ego goes after 2.5 s, on its fourth question.
    asked = tally.total("asked").reshape(2, 2, passes.AWAY_BINS)
    # The first ones are beyond the last bin.
    away = 1500.0 - (EGO + COMES) * np.array([0.0, 1.0, 2.0, 2.45]) - 5.0
    near = away < passes.AWAY_BINS * passes.AWAY_WIDTH
    assert asked[0].sum() == near[:3].sum()
    assert asked[1].sum() == near[3:].sum()
    tally = counted(made(1900.0))
    asked = tally.total("asked").reshape(2, 2, passes.AWAY_BINS)
    # 895 m off at first, where one sees 886 m; then 845, 795 and 772 m off, and in sight.
    assert asked.sum(axis=(1, 2)).tolist() == [2.0, 1.0]
    assert asked[:, 0].sum() == 0.0  # It is a motorcycle that comes.
    assert tally.total("refused").argmax() == int(
        passes.meeting(made(1900.0), np.array([0]), np.array([0]))[0][0] / passes.GAP_WIDTH
    )


def by_another(pace: float, *, until: float = BACK, aside: float = 1.75) -> Trajectories:
    """The ego drives steadily; the truck comes from 40 m behind and is in the other lane."""
    runs = driven()
    t = 0.05 * np.arange(runs.states.s.shape[2])
    s, d, speed, lane = (getattr(runs.states, name).copy() for name in ("s", "d", "speed", "lane"))
    ways = (1040.0 + LEADER * t, 1000.0 + pace * t, 2500.0 - COMES * t)
    for slot, (way, now) in enumerate(zip(ways, (LEADER, pace, COMES), strict=True)):
        s[0, slot], speed[0, slot] = np.rint(1e3 * way), 1e3 * now
    d[0, 0], lane[0, 0] = -1750, 0
    d[0, 1] = np.where((t >= OUT) & (t <= until), 1e3 * aside, -1750)
    stage = np.full_like(runs.stage, Stage.FOLLOW)
    return runs.replace(states=runs.states.replace(s=s, d=d, speed=speed, lane=lane), stage=stage)


def test_what_others_pass_is_told_from_what_they_drive():
    (one,) = passes.attempts_of_others(by_another(EGO))
    lengths = driven().scenario.vehicles.length[0]
    apart = 1500.0 - (EGO + COMES) * BACK - 0.5 * float(lengths[1] + lengths[2])
    assert (one.row, one.slot, one.target, one.passed) == (0, 1, 0, True)
    assert one.duration == pytest.approx(BACK - OUT)
    assert one.margin == pytest.approx(apart / (EGO + COMES), abs=1e-3)
    (other,) = passes.attempts_of_others(by_another(LEADER))
    assert not other.passed


def test_a_wander_is_no_attempt_and_neither_is_one_that_is_open_at_the_end():
    half_width = 0.5 * float(driven().scenario.vehicles.width[0, 1])
    assert not passes.attempts_of_others(by_another(EGO, aside=0.4 - half_width))
    assert len(passes.attempts_of_others(by_another(EGO, aside=0.6 - half_width))) == 1
    assert not passes.attempts_of_others(by_another(EGO, until=100.0))


def test_attempts_of_others_are_counted_by_the_time_that_they_drive():
    tally = counted(by_another(EGO))
    seconds = 0.05 * driven().num_frames[0]
    figure = BY_NAME["others_per_hour"].measured(tally)
    assert figure.value == pytest.approx(3600.0 / seconds)
    assert BY_NAME["others_aborted"].measured(tally).value == 0.0
    assert BY_NAME["others_time"].measured(tally).value == pytest.approx(BACK - OUT)
    assert math.isnan(BY_NAME["others_unsafe"].measured(counted(made())).value)


def test_a_regression_is_that_of_least_squares_by_weight():
    rng = np.random.default_rng(3)
    number = 400
    runs = driven()
    batch = dataclasses.replace(
        Batch.of(runs),
        group=rng.integers(0, GROUPS, number),
        weight=rng.uniform(0.2, 2.0, number),
    )
    x, y = rng.normal(size=(2, number)), rng.normal(size=number)
    where = rng.uniform(size=number) < 0.8
    tally = Tally()
    passes.regress(tally, "it", batch, np.arange(number), list(x), y, where)
    design = np.column_stack([np.ones(number), *x])[where]
    root = np.sqrt(batch.weight[where])
    expected = np.linalg.lstsq(root[:, None] * design, root * y[where], rcond=None)[0]
    found = [passes.slope(tally.total("it_sums"), of) for of in range(3)]
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def histogram(tally: Tally, name: str, values: np.ndarray) -> None:
    group = np.arange(len(values)) % GROUPS
    tally.add_binned(name, group, values / passes.GAP_WIDTH, np.ones(1), passes.GAP_BINS)


def test_the_critical_gap_is_where_accepted_and_refused_ones_cross():
    tally = Tally()
    histogram(tally, "offers_safe", np.linspace(10.0, 30.0, 2001))
    histogram(tally, "offers_unsafe", np.zeros(0))
    histogram(tally, "refused", np.linspace(0.0, 20.0, 2001))
    # (g - 10) / 20 = (20 - g) / 20.
    assert passes.critical_gap(tally) == pytest.approx(15.0, abs=0.5)


def test_the_safe_gap_is_that_of_a_logistic_regression():
    rng = np.random.default_rng(5)
    gap = rng.uniform(5.0, 40.0, 3000)
    safe = rng.uniform(size=3000) < 1.0 / (1.0 + np.exp(-(gap - 14.0) / 3.0))
    tally = Tally()
    histogram(tally, "offers_safe", gap[safe])
    histogram(tally, "offers_unsafe", gap[~safe])

    def cost(w: np.ndarray) -> float:
        z = w[0] + w[1] * gap
        return float(np.logaddexp(0.0, np.where(safe, -z, z)).sum())

    w = scipy.optimize.minimize(cost, [0.0, 0.1]).x
    expected = (math.log(0.85 / 0.15) - w[0]) / w[1]
    assert passes.safe_gap(tally) == pytest.approx(expected, abs=0.1)


def test_the_favour_of_motorcycles_is_the_odds_ratio_within_a_distance():
    tally, bins = Tally(), passes.AWAY_BINS
    refused, refused_small, taken, taken_small = (bins * k + 7 for k in range(4))
    for place, number in ((refused, 90), (refused_small, 8), (taken, 10), (taken_small, 4)):
        places = np.full(number, place)
        tally.add_binned("asked", places % GROUPS, places, np.ones(1), 4 * bins)
    assert passes.favour_of_small(tally) == pytest.approx(math.log((4 * 90) / (10 * 8)))


def test_a_head_on_collision_is_told_from_others():
    world = ScenarioSource(load_specification("rural-risk"), load_road("rural"), 4).sample(
        np.arange(8, dtype=np.uint64)
    )
    runs = engine.run(world, step_parameters(world))
    contacts = runs.contacts
    partner, impulse = contacts.partner.copy(), contacts.impulse.copy()
    time, stage = contacts.time.copy(), runs.stage.copy()
    partner[:, 0] = 255
    stage[:] = Stage.PASS
    stage[:, 0] = Stage.PULL_OUT
    comes = [int(np.flatnonzero(lane == 1)[0]) for lane in world.start_lane]
    for row, other in ((0, comes[0]), (1, comes[1]), (2, 1)):
        partner[row, 0], time[row, 0] = other, 1000
        # The ego's speed changes by 10 m/s, in the second one by 1 m/s.
        impulse[row, 0] = (1.0 if row == 1 else 10.0) * world.vehicles.mass[row, 0]
        impulse[row, other] = 0.0
    hit = runs.replace(
        stage=stage, contacts=contacts.replace(partner=partner, impulse=impulse, time=time)
    )
    tally = Tally()
    passes._collisions(tally, Batch.of(hit), np.ones(8, bool))
    weight = world.weight
    assert tally.total("collided").sum() == pytest.approx(weight[:3].sum())
    assert tally.total("hard").sum() == pytest.approx(weight[[0, 2]].sum())
    assert tally.total("head_on").sum() == pytest.approx(weight[0])
    share = weight[0] / (weight[0] + weight[2])
    found = HEAD_ON.measured(tally)
    assert found.value == pytest.approx(share)
    assert found.low < share < found.high


def test_three_head_on_collisions_of_three_do_not_settle_the_share():
    tally, groups = Tally(), np.arange(3)
    for name, values in (("hard", 0.5), ("head_on", 0.5), ("hard_squares", 0.25)):
        tally.add(name, groups, np.full(3, values))
    found = HEAD_ON.measured(tally)
    known = scipy.stats.binomtest(3, 3).proportion_ci(method="wilson")
    assert (found.value, found.high) == (1.0, 1.0)
    assert found.low == pytest.approx(known.low, rel=1e-9)
    assert found.met is False
    assert not found.is_sure
    nothing = HEAD_ON.measured(Tally())
    assert np.isnan([nothing.value, nothing.low, nothing.high]).all()
    assert nothing.has_target
    assert nothing.met is None


def test_a_share_is_never_more_than_all():
    tally, groups = Tally(), np.arange(20)
    for name, values in (("hard", 1.0), ("head_on", groups > 0), ("hard_squares", 1.0)):
        tally.add(name, groups, np.full(20, values, np.float64))
    found = HEAD_ON.measured(tally)
    assert (found.value, found.high) == (pytest.approx(0.95), 1.0)


def test_flows_are_those_that_the_traffic_was_drawn_with():
    given = load_specification(
        "rural", {"traffic.flow_vph": [300.0, 300.0], "traffic.split": [0.7, 0.7]}
    )
    index = np.arange(400, dtype=np.uint64)
    own, other = flows_per_second(given, 3, index)
    assert sorted(set(np.rint(3600.0 * own).tolist())) == [180.0, 420.0]
    np.testing.assert_allclose(own + other, 600.0 / 3600.0, rtol=1e-6)
    world = ScenarioSource(given, load_road("rural"), 3).sample(index)
    # Where more go along, the nearest of those ahead who are not held up are nearer.
    ahead = world.start_s[:, 6] - world.start_s[:, 1]
    there = world.vehicles.valid[:, 6] & (world.start_lane[:, 6] == 0)
    busy = own > other
    assert 1.5 * np.median(ahead[there & busy]) < np.median(ahead[there & ~busy])
