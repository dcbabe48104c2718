"""Counts and measures of passes in recordings that are known by construction."""

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

CROSSING_TIME, RETURN_TIME = 3.0, 11.0
"""When the passing vehicle is in the other lane: from the first to the second time [s]."""
EGO_SPEED, LEADER_SPEED, ONCOMING_SPEED = 25.0, 20.0, 25.0
"""Speeds [m/s]."""
FIGURES_BY_NAME = {figure.name: figure for figure in (*PASSES, HEAD_ON)}


@cache
def simulated_pass() -> Trajectories:
    """A simulated ego that passes a truck before an oncoming motorcycle arrives."""
    passing_driver = {"gap_demand_factor": 0.0, "desired_speed": 30.0, "min_speed_gain": 1.0}
    vehicles = [
        Vehicle(s=1000.0, speed=EGO_SPEED, driver=passing_driver),
        Vehicle(kind="T", s=1050.0, speed=LEADER_SPEED, driver={"desired_speed": LEADER_SPEED}),
        Vehicle(
            kind="MC",
            s=2500.0,
            lane=1,
            speed=ONCOMING_SPEED,
            driver={"desired_speed": ONCOMING_SPEED},
        ),
    ]
    world = scenario(vehicles, road=known_road("rural").extend_to(8000.0), horizon=20.0)
    return engine.run(world, step_parameters(world))


def steady_pass(oncoming_start: float = 2500.0) -> Trajectories:
    """The same with constant speeds and the ego in the other lane in a known interval.

    Args:
        oncoming_start: Station of the oncoming motorcycle at time 0 [m].
    """
    runs = simulated_pass()
    time = 0.05 * np.arange(runs.states.s.shape[2])
    is_away = (time >= CROSSING_TIME) & (time <= RETURN_TIME)
    s, d, speed, lane = (getattr(runs.states, name).copy() for name in ("s", "d", "speed", "lane"))
    stations = (
        1000.0 + EGO_SPEED * time,
        1040.0 + LEADER_SPEED * time,
        oncoming_start - ONCOMING_SPEED * time,
    )
    for slot, (station, constant_speed) in enumerate(
        zip(stations, (EGO_SPEED, LEADER_SPEED, ONCOMING_SPEED), strict=True)
    ):
        s[0, slot], speed[0, slot] = np.rint(1e3 * station), 1e3 * constant_speed
    d[0, 0], lane[0, 0] = np.where(is_away, 1750, -1750), is_away
    stages = [Stage.FOLLOW, Stage.PULL_OUT, Stage.PASS, Stage.RETURN, Stage.DONE]
    stage = np.array(stages, runs.stage.dtype)[
        np.searchsorted([2.5, 5.0, 10.0, 12.0], time, "right")
    ]
    return runs.replace(
        states=runs.states.replace(s=s, d=d, speed=speed, lane=lane), stage=stage[None]
    )


def tally_of(runs: Trajectories) -> Tally:
    tally = Tally()
    passes.count(tally, Batch.of(runs))
    return tally


def test_a_pass_lasts_from_the_crossing_of_the_line_until_the_return():
    (measured_pass,) = passes.passes(steady_pass())
    lengths = simulated_pass().scenario.vehicles.length[0]
    assert measured_pass.duration == pytest.approx(RETURN_TIME - CROSSING_TIME)
    assert measured_pass.way == pytest.approx(EGO_SPEED * (RETURN_TIME - CROSSING_TIME))
    assert measured_pass.surplus == pytest.approx(EGO_SPEED - LEADER_SPEED)
    assert measured_pass.passed_speed == pytest.approx(LEADER_SPEED)
    # The ego starts 40 m behind and closes 5 m every second: it is abreast after 8 s.
    commitment_time = 8.0 - 0.5 * float(lengths[1]) / (EGO_SPEED - LEADER_SPEED)
    assert measured_pass.no_return == pytest.approx(
        (commitment_time - CROSSING_TIME) / (RETURN_TIME - CROSSING_TIME), abs=0.01
    )
    assert measured_pass.is_truck
    return_gap = (
        (EGO_SPEED - LEADER_SPEED) * RETURN_TIME - 40.0 - 0.5 * float(lengths[0] + lengths[1])
    )
    assert measured_pass.left == pytest.approx(return_gap / LEADER_SPEED, abs=1e-3)
    oncoming_gap = (
        1500.0 - (EGO_SPEED + ONCOMING_SPEED) * RETURN_TIME - 0.5 * float(lengths[0] + lengths[2])
    )
    assert measured_pass.margin == pytest.approx(
        oncoming_gap / (EGO_SPEED + ONCOMING_SPEED), abs=1e-3
    )
    assert measured_pass.away == pytest.approx(
        oncoming_gap + (EGO_SPEED + ONCOMING_SPEED) * (RETURN_TIME - 2.5), abs=1e-3
    )
    assert measured_pass.offered == pytest.approx(
        measured_pass.margin + RETURN_TIME - 2.5, abs=1e-3
    )
    assert measured_pass.their_speed == ONCOMING_SPEED
    assert measured_pass.same
    # The markings allow crossing the line from 810 to 1,606 m; the ego decides at 1,062.5 m.
    assert measured_pass.zone == pytest.approx(796.0)
    assert measured_pass.too_fast == (known_road("rural").speed_limit < EGO_SPEED)


@pytest.mark.parametrize(
    ("start", "direction", "too_fast"), [(1270.0, 1, True), (1280.0, 1, False), (1100.0, -1, False)]
)
def test_a_pass_is_too_fast_by_the_speed_limit_of_its_station_and_direction(
    start: float, direction: int, too_fast: bool
):
    # The ego is in the other lane from 1075 m to 1275 m.
    slow_span = SpeedLimitSpan(start=start, stop=1400.0, speed=20.0, direction=direction)
    runs = steady_pass()
    assert not runs.road.course or not runs.road.course.speed_limit_spans
    road = dataclasses.replace(
        runs.road,
        course=dataclasses.replace(
            runs.road.course or RoadCourse(), speed_limit_spans=(slow_span,)
        ),
    )
    (measured_pass,) = passes.passes(runs.replace(scenario=runs.scenario.replace(road=road)))
    assert measured_pass.too_fast == too_fast


@pytest.mark.parametrize(
    # `safe_margin` is 3 s, `scarce_margin` 1 s.
    ("margin", "unsafe", "scarce"),
    [(5.0, 0.0, 0.0), (2.0, 1.0, 0.0), (0.5, 1.0, 1.0)],
)
def test_a_pass_with_a_short_margin_before_the_oncoming_vehicle_is_unsafe_or_scarce(
    margin, unsafe, scarce
):
    lengths = simulated_pass().scenario.vehicles.length[0]
    oncoming_start = (
        1000.0
        + (EGO_SPEED + ONCOMING_SPEED) * (RETURN_TIME + margin)
        + 0.5 * float(lengths[0] + lengths[2])
    )
    tally = tally_of(steady_pass(oncoming_start))
    assert passes.mean_of(tally, "unsafe") == unsafe
    assert passes.mean_of(tally, "scarce") == scarce
    assert tally.total("offers_unsafe").sum() == unsafe
    assert passes.mean_of(tally, "duration") == pytest.approx(RETURN_TIME - CROSSING_TIME)


def test_a_pass_without_an_oncoming_vehicle_has_no_margin():
    tally = tally_of(steady_pass(6000.0))
    assert math.isnan(passes.mean_of(tally, "unsafe"))
    assert tally.total("duration_number")[0] == 1.0


def test_a_follower_refuses_a_gap_once_a_second_until_it_passes():
    tally = tally_of(steady_pass())
    # The ego is within 3 s of its leader all the time; it accepts the fourth gap, after 2.5 s.
    # Axes: refused or accepted, other vehicle or motorcycle, bin of distance.
    decisions = tally.total("asked").reshape(2, 2, passes.AWAY_BINS)
    # Distances at the first decisions lie beyond the last bin.
    distance = 1500.0 - (EGO_SPEED + ONCOMING_SPEED) * np.array([0.0, 1.0, 2.0, 2.45]) - 5.0
    in_bins = distance < passes.AWAY_BINS * passes.AWAY_WIDTH
    assert decisions[0].sum() == in_bins[:3].sum()
    assert decisions[1].sum() == in_bins[3:].sum()
    tally = tally_of(steady_pass(1900.0))
    decisions = tally.total("asked").reshape(2, 2, passes.AWAY_BINS)
    # The motorcycle is 895 m away at first, where the ego sees 886 m; it is in sight at the next
    # decisions, 845, 795 and 772 m away.
    assert decisions.sum(axis=(1, 2)).tolist() == [2.0, 1.0]
    assert decisions[:, 0].sum() == 0.0  # None is a gap before another vehicle than a motorcycle.
    assert tally.total("refused").argmax() == int(
        passes.meeting(steady_pass(1900.0), np.array([0]), np.array([0]))[0][0] / passes.GAP_WIDTH
    )


def pass_of_ego(
    truck_speed: float, *, until: float = RETURN_TIME, offset: float = 1.75
) -> Trajectories:
    """A truck starts 40 m behind a steady ego and uses the other lane.

    Args:
        truck_speed: Speed of the truck [m/s].
        until: When the truck returns [s].
        offset: Lateral offset of the truck in the other lane [m].
    """
    runs = simulated_pass()
    time = 0.05 * np.arange(runs.states.s.shape[2])
    s, d, speed, lane = (getattr(runs.states, name).copy() for name in ("s", "d", "speed", "lane"))
    stations = (
        1040.0 + LEADER_SPEED * time,
        1000.0 + truck_speed * time,
        2500.0 - ONCOMING_SPEED * time,
    )
    for slot, (station, constant_speed) in enumerate(
        zip(stations, (LEADER_SPEED, truck_speed, ONCOMING_SPEED), strict=True)
    ):
        s[0, slot], speed[0, slot] = np.rint(1e3 * station), 1e3 * constant_speed
    d[0, 0], lane[0, 0] = -1750, 0
    d[0, 1] = np.where((time >= CROSSING_TIME) & (time <= until), 1e3 * offset, -1750)
    stage = np.full_like(runs.stage, Stage.FOLLOW)
    return runs.replace(states=runs.states.replace(s=s, d=d, speed=speed, lane=lane), stage=stage)


def test_a_truck_that_passes_the_ego_is_measured_from_its_positions():
    (attempt,) = passes.attempts_of_others(pass_of_ego(EGO_SPEED))
    lengths = simulated_pass().scenario.vehicles.length[0]
    oncoming_gap = (
        1500.0 - (EGO_SPEED + ONCOMING_SPEED) * RETURN_TIME - 0.5 * float(lengths[1] + lengths[2])
    )
    assert (attempt.row, attempt.slot, attempt.target, attempt.passed) == (0, 1, 0, True)
    assert attempt.duration == pytest.approx(RETURN_TIME - CROSSING_TIME)
    assert attempt.margin == pytest.approx(oncoming_gap / (EGO_SPEED + ONCOMING_SPEED), abs=1e-3)
    (abandoned,) = passes.attempts_of_others(pass_of_ego(LEADER_SPEED))
    assert not abandoned.passed


def test_wandering_over_the_line_and_an_unfinished_pass_are_no_attempts():
    # An attempt reaches at least `begun_shift`, 0.5 m, beyond the line.
    half_width = 0.5 * float(simulated_pass().scenario.vehicles.width[0, 1])
    assert not passes.attempts_of_others(pass_of_ego(EGO_SPEED, offset=0.4 - half_width))
    assert len(passes.attempts_of_others(pass_of_ego(EGO_SPEED, offset=0.6 - half_width))) == 1
    assert not passes.attempts_of_others(pass_of_ego(EGO_SPEED, until=100.0))


def test_attempts_of_other_vehicles_are_counted_per_hour_of_driving():
    tally = tally_of(pass_of_ego(EGO_SPEED))
    seconds = 0.05 * simulated_pass().num_frames[0]
    figure = FIGURES_BY_NAME["others_per_hour"].measured(tally)
    assert figure.value == pytest.approx(3600.0 / seconds)
    assert FIGURES_BY_NAME["others_aborted"].measured(tally).value == 0.0
    assert FIGURES_BY_NAME["others_time"].measured(tally).value == pytest.approx(
        RETURN_TIME - CROSSING_TIME
    )
    assert math.isnan(FIGURES_BY_NAME["others_unsafe"].measured(tally_of(steady_pass())).value)


def test_a_regression_of_passes_equals_weighted_least_squares():
    rng = np.random.default_rng(3)
    size = 400
    runs = simulated_pass()
    batch = dataclasses.replace(
        Batch.of(runs),
        group=rng.integers(0, GROUPS, size),
        weight=rng.uniform(0.2, 2.0, size),
    )
    x, y = rng.normal(size=(2, size)), rng.normal(size=size)
    is_used = rng.uniform(size=size) < 0.8
    tally = Tally()
    passes.regress(tally, "it", batch, np.arange(size), list(x), y, is_used)
    design = np.column_stack([np.ones(size), *x])[is_used]
    root_weight = np.sqrt(batch.weight[is_used])
    expected = np.linalg.lstsq(root_weight[:, None] * design, root_weight * y[is_used], rcond=None)[
        0
    ]
    coefficients = [passes.slope(tally.total("it_sums"), index) for index in range(3)]
    np.testing.assert_allclose(coefficients, expected, rtol=1e-9)


def add_histogram(tally: Tally, name: str, gaps: np.ndarray) -> None:
    """Add gaps [s] to a histogram, spread over the groups."""
    group = np.arange(len(gaps)) % GROUPS
    tally.add_binned(name, group, gaps / passes.GAP_WIDTH, np.ones(1), passes.GAP_BINS)


def test_the_critical_gap_is_where_shares_of_accepted_and_refused_gaps_cross():
    tally = Tally()
    add_histogram(tally, "offers_safe", np.linspace(10.0, 30.0, 2001))
    add_histogram(tally, "offers_unsafe", np.zeros(0))
    add_histogram(tally, "refused", np.linspace(0.0, 20.0, 2001))
    # (g - 10) / 20 = (20 - g) / 20 at g = 15.
    assert passes.critical_gap(tally) == pytest.approx(15.0, abs=0.5)


def test_the_safe_gap_equals_a_logistic_regression_at_85_percent():
    rng = np.random.default_rng(5)
    gap = rng.uniform(5.0, 40.0, 3000)
    safe = rng.uniform(size=3000) < 1.0 / (1.0 + np.exp(-(gap - 14.0) / 3.0))
    tally = Tally()
    add_histogram(tally, "offers_safe", gap[safe])
    add_histogram(tally, "offers_unsafe", gap[~safe])

    def cost(weights: np.ndarray) -> float:
        z = weights[0] + weights[1] * gap
        return float(np.logaddexp(0.0, np.where(safe, -z, z)).sum())

    weights = scipy.optimize.minimize(cost, [0.0, 0.1]).x
    # At the safe gap, `safe_share` of 0.85 of the passes keep the safe margin.
    expected = (math.log(0.85 / 0.15) - weights[0]) / weights[1]
    assert passes.safe_gap(tally) == pytest.approx(expected, abs=0.1)


def test_acceptance_before_motorcycles_is_an_odds_ratio_among_equal_distances():
    tally, bins = Tally(), passes.AWAY_BINS
    refused, refused_small, accepted, accepted_small = (bins * part + 7 for part in range(4))
    for bin_number, number in (
        (refused, 90),
        (refused_small, 8),
        (accepted, 10),
        (accepted_small, 4),
    ):
        bin_numbers = np.full(number, bin_number)
        tally.add_binned("asked", bin_numbers % GROUPS, bin_numbers, np.ones(1), 4 * bins)
    assert passes.favour_of_small(tally) == pytest.approx(math.log((4 * 90) / (10 * 8)))


def test_a_head_on_collision_is_a_hard_collision_with_an_oncoming_vehicle():
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
    oncoming = [int(np.flatnonzero(lane == 1)[0]) for lane in world.start_lane]
    for row, struck in ((0, oncoming[0]), (1, oncoming[1]), (2, 1)):
        partner[row, 0], time[row, 0] = struck, 1000
        # The ego's speed changes by 10 m/s, and by 1 m/s in the second simulation.
        impulse[row, 0] = (1.0 if row == 1 else 10.0) * world.vehicles.mass[row, 0]
        impulse[row, struck] = 0.0
    collided = runs.replace(
        stage=stage, contacts=contacts.replace(partner=partner, impulse=impulse, time=time)
    )
    tally = Tally()
    passes._collisions(tally, Batch.of(collided), np.ones(8, bool))
    weight = world.weight
    assert tally.total("collided").sum() == pytest.approx(weight[:3].sum())
    assert tally.total("hard").sum() == pytest.approx(weight[[0, 2]].sum())
    assert tally.total("head_on").sum() == pytest.approx(weight[0])
    head_on_share = weight[0] / (weight[0] + weight[2])
    figure = HEAD_ON.measured(tally)
    assert figure.value == pytest.approx(head_on_share)
    assert figure.low < head_on_share < figure.high


def test_three_head_on_collisions_of_three_leave_the_share_uncertain():
    tally, groups = Tally(), np.arange(3)
    for name, values in (("hard", 0.5), ("head_on", 0.5), ("hard_squares", 0.25)):
        tally.add(name, groups, np.full(3, values))
    figure = HEAD_ON.measured(tally)
    wilson = scipy.stats.binomtest(3, 3).proportion_ci(method="wilson")
    assert (figure.value, figure.high) == (1.0, 1.0)
    assert figure.low == pytest.approx(wilson.low, rel=1e-9)
    assert figure.met is False
    assert not figure.is_sure
    empty = HEAD_ON.measured(Tally())
    assert np.isnan([empty.value, empty.low, empty.high]).all()
    assert empty.has_target
    assert empty.met is None


def test_the_upper_limit_of_a_share_is_at_most_one():
    tally, groups = Tally(), np.arange(20)
    for name, values in (("hard", 1.0), ("head_on", groups > 0), ("hard_squares", 1.0)):
        tally.add(name, groups, np.full(20, values, np.float64))
    figure = HEAD_ON.measured(tally)
    assert (figure.value, figure.high) == (pytest.approx(0.95), 1.0)


def test_traffic_is_denser_in_the_direction_with_the_larger_flow():
    specification = load_specification(
        "rural", {"traffic.flow_vph": [300.0, 300.0], "traffic.split": [0.7, 0.7]}
    )
    index = np.arange(400, dtype=np.uint64)
    ego_flow, oncoming_flow = flows_per_second(specification, 3, index)
    assert sorted(set(np.rint(3600.0 * ego_flow).tolist())) == [180.0, 420.0]
    np.testing.assert_allclose(ego_flow + oncoming_flow, 600.0 / 3600.0, rtol=1e-6)
    world = ScenarioSource(specification, load_road("rural"), 3).sample(index)
    # Vehicles of the ego's direction in slots 1 and 6 are closer together where its flow is larger.
    spacing = world.start_s[:, 6] - world.start_s[:, 1]
    is_present = world.vehicles.valid[:, 6] & (world.start_lane[:, 6] == 0)
    is_busy = ego_flow > oncoming_flow
    assert 1.5 * np.median(spacing[is_present & is_busy]) < np.median(
        spacing[is_present & ~is_busy]
    )
