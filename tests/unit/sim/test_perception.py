"""What drivers notice, how late and how wrongly: each effect alone, against published ranges."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from tests.support.minds import CLEAR_MINDED, Moment, moment
from tests.support.worlds import Vehicle, wide_road

from overtaking.sim.reference.perception import checks_mirrors_now
from overtaking.sim.reference.state import FOLLOWER, LEADER, LEFT_FOLLOWER, LEFT_LEADER
from overtaking.world.constants import EnabledEffects

UNSEEN = 1000.0
CAR = 4.4  # Length of both cars [m].


def one_ahead(distance: float, *, speed: float = 30.0, ahead: float = 20.0, **options) -> Moment:
    """A car with another `distance` metres before its bumper."""
    kind = options.pop("kind", "M")
    length = {"M": CAR, "T": 8.0}[kind]
    driver = options.pop("driver", {})
    leader = Vehicle(kind=kind, s=0.5 * (CAR + length) + distance, speed=ahead)
    return moment([Vehicle(speed=speed, driver=driver), leader], **options)


def seen(m: Moment, decisions: int = 1) -> bool:
    for _ in range(decisions - 1):
        m.look()
    return bool(m.look().is_detected[LEADER, 0, 0])


def range_of_sight(effects: EnabledEffects, weather: dict[str, float], **options) -> float:
    """Largest gap at which a leader is noticed, once there has been time enough [m]."""
    low, high = 1.0, 20_000.0
    for _ in range(24):
        middle = 0.5 * (low + high)
        m = one_ahead(middle, speed=0.0, effects=effects, weather=weather, **options)
        low, high = (middle, high) if seen(m) else (low, middle)
    return low


ONLY_RANGE = dataclasses.replace(CLEAR_MINDED, range=True)


def test_a_clear_mind_believes_what_is():
    m = one_ahead(80.0)
    believed = m.look()
    assert bool(believed.is_detected[LEADER, 0, 0])
    assert float(believed.gap[LEADER, 0, 0]) == pytest.approx(80.0, abs=1e-4)
    assert float(believed.closing_speed[LEADER, 0, 0]) == pytest.approx(10.0, abs=1e-4)


def test_who_is_not_noticed_is_far_away_and_does_not_approach():
    m = one_ahead(400.0, effects=ONLY_RANGE)
    believed = m.look()
    assert not bool(believed.is_detected[LEADER, 0, 0])
    assert float(believed.gap[LEADER, 0, 0]) == UNSEEN
    assert float(believed.closing_speed[LEADER, 0, 0]) == 0.0


def test_attention_ends_at_300_m_ahead_and_at_150_m_in_the_mirror():
    assert range_of_sight(ONLY_RANGE, {}) == pytest.approx(300.0, abs=0.1)
    for gap, noticed in ((149.0, True), (151.0, False)):
        cars = [Vehicle(s=500.0), Vehicle(s=500.0 - CAR - gap)]
        m = moment(cars, effects=ONLY_RANGE)
        assert bool(m.look().is_detected[FOLLOWER, 0, 0]) is noticed


@pytest.mark.parametrize(("fog", "mor"), [(90.0, 85.0), (100.0, 50.0)])
def test_in_fog_by_day_an_unlit_car_is_seen_as_far_as_koschmieder_says(fog: float, mor: float):
    # Contrast 0.8 falls to 0.05 after ln(16) / beta; so near, lamps do not carry farther by day.
    weather = {"fog": fog}
    beta = 3.0 / (10_000.0 * (50.0 / 10_000.0) ** (fog / 100.0))
    assert 3.0 / beta == pytest.approx(mor, rel=0.01)
    m = one_ahead(30.0, effects=ONLY_RANGE, weather=weather)
    m.p.inverse_tail_lamp[:] = 1e9  # All lamps off.
    reach = math.log(0.8 / 0.05) / beta
    for share, noticed in ((0.98, True), (1.02, False)):
        m.state.motion.s[1] = share * reach + CAR
        assert bool(m.look().is_detected[LEADER, 0, 0]) is noticed


@pytest.mark.ci
@pytest.mark.parametrize(("fog", "night", "metres"), [(100.0, 1.0, 154.0), (100.0, 0.0, 91.0)])
def test_in_fog_a_rear_fog_lamp_is_seen_as_far_as_allard_says(
    fog: float, night: float, metres: float
):
    # 200 cd; range worked out by hand for a threshold of 8e-7 lx by night and 1e-4 lx by day.
    weather = {"fog": fog, "night": night, "sun_altitude": -1.0 if night else 1.0}
    assert range_of_sight(ONLY_RANGE, weather) == pytest.approx(metres, rel=0.01)


def test_a_braking_leader_is_seen_farther_in_fog_at_night():
    # 60 %: an extinction below that at which fog lamps are lit, so 8 cd against 100 cd.
    weather = {"fog": 85.0, "night": 1.0, "sun_altitude": -1.0}
    coasting = range_of_sight(ONLY_RANGE, weather)
    m = one_ahead(1.15 * coasting, speed=0.0, effects=ONLY_RANGE, weather=weather)
    assert not seen(m)
    m.state.controls.requested_accel[1] = -3.0
    assert seen(m)


def test_spray_hides_a_lorry_on_a_wet_road():
    weather = {"rain": 100.0, "fog": 80.0}
    near = {"speed": 25.0, "ahead": 25.0, "kind": "T", "effects": ONLY_RANGE, "weather": weather}
    lorry = one_ahead(30.0, **near)
    car = one_ahead(30.0, **(near | {"kind": "M"}))
    for m in (lorry, car):
        m.p.inverse_tail_lamp[:] = 1e9
    # A lorry throws up four times the spray of a car: 0.048 against 0.012 per metre.
    assert seen(car)
    assert not seen(lorry)


DELAYED = dataclasses.replace(CLEAR_MINDED, delay=True)


@pytest.mark.parametrize(("night", "seconds"), [(0.0, 0.4), (1.0, 0.6)])
def test_a_newcomer_is_noticed_after_the_detection_time(night: float, seconds: float):
    m = moment([Vehicle(s=0.0), Vehicle(s=30.0, lane=2)], effects=DELAYED, weather={"night": night})
    m.look()
    m.state.motion.d[1] = m.state.motion.d[
        0
    ]  # Out of nowhere, near: no extra time at the limit of sight.
    m.state.lane_choice.lane[1] = 0.0
    count = 0
    while not seen(m):
        count += 1
        assert count < 40
    assert count * 0.05 == pytest.approx(seconds, abs=0.051)


def test_who_was_there_from_the_start_is_known():
    assert seen(one_ahead(30.0, effects=DELAYED))


@pytest.mark.ci
@pytest.mark.parametrize("reaction", [0.5, 1.25])
def test_a_driver_acts_on_what_was_a_reaction_time_ago_carried_on(reaction: float):
    m = one_ahead(60.0, speed=20.0, ahead=20.0, driver={"reaction_time": reaction}, effects=DELAYED)
    ticks = round(reaction * 20.0)
    for _ in range(40):
        m.look()
        m.pass_time()
    # The leader jumps on by 7 m and is 5 m/s slower: nobody knows before a reaction time is over.
    m.state.motion.s[1] += 7.0
    m.state.motion.vx[1] = 15.0
    gaps, closings = [], []
    for _ in range(ticks + 2):
        believed = m.look()
        gaps.append(float(believed.gap[LEADER, 0, 0]))
        closings.append(float(believed.closing_speed[LEADER, 0, 0]))
        m.pass_time()
    np.testing.assert_allclose(gaps[:ticks], 60.0, atol=1e-3)
    np.testing.assert_allclose(closings[:ticks], 0.0, atol=1e-4)
    # Then it is known, and what happened since is extrapolated rightly, as it kept its speed.
    truth = float(m.state.motion.s[1, 0] - m.state.motion.s[0, 0]) - CAR + 0.05 * 5.0
    assert gaps[-1] == pytest.approx(truth, abs=1e-3)
    assert closings[-1] == pytest.approx(5.0, abs=1e-4)


def test_a_lorry_hides_the_car_before_it_from_a_follower_but_not_from_beside():
    occluded = dataclasses.replace(CLEAR_MINDED, occlusion=True)
    # The car in the next lane stands behind the lorry's corner as seen from the follower.
    cars = [
        Vehicle(s=0.0, lane=0),
        Vehicle(kind="T", s=20.0, lane=0),
        Vehicle(s=200.0, lane=1),
        Vehicle(s=60.0, lane=2),
    ]
    believed = moment(cars, effects=occluded).look()
    assert bool(believed.is_detected[LEADER, 0, 0])
    # The line of sight to 3.5 m aside at 200 m passes 0.3 m beside the lorry's axis: hidden.
    assert not bool(believed.is_detected[LEFT_LEADER, 0, 0])
    assert bool(moment(cars, effects=CLEAR_MINDED).look().is_detected[LEFT_LEADER, 0, 0])
    cars[1] = Vehicle(kind="M", s=20.0, lane=0)  # One looks over a car.
    assert bool(moment(cars, effects=occluded).look().is_detected[LEFT_LEADER, 0, 0])


@pytest.mark.parametrize("checks", [0.0, 1.0])
def test_only_who_checks_it_sees_into_the_blind_spot(checks: float):
    beside = [
        Vehicle(s=100.0, driver={"checks_blind_spot": checks}),
        Vehicle(s=97.0, lane=1),
    ]
    believed = moment(beside).look()
    assert bool(believed.is_detected[LEFT_FOLLOWER, 0, 0]) is bool(checks)
    behind = [beside[0], Vehicle(s=100.0 - CAR - 6.0, lane=1)]
    assert bool(moment(behind).look().is_detected[LEFT_FOLLOWER, 0, 0])  # The mirror shows that.


# Distance at which the closing of a vehicle looms by 0.003 rad/s, sqrt(w dv / 0.003).
LOOMING = [("M", 5.0, 55.0), ("M", 10.0, 77.0), ("M", 20.0, 110.0), ("T", 20.0, 129.0)]


@pytest.mark.parametrize(("kind", "closing", "metres"), LOOMING)
def test_an_approach_is_felt_from_the_distance_of_looming_on(
    kind: str, closing: float, metres: float
):
    looming = dataclasses.replace(CLEAR_MINDED, looming=True)
    felt: list[float] = []
    # All of it is felt at 1.3 times the threshold, 0.877 times the distance.
    for share in (0.86, 0.94, 1.03):
        m = one_ahead(share * metres, speed=30.0, ahead=30.0 - closing, kind=kind, effects=looming)
        believed = m.look()
        assert bool(believed.is_detected[LEADER, 0, 0])
        felt.append(float(believed.closing_speed[LEADER, 0, 0]))
    near, between, far = felt
    assert near == pytest.approx(closing, rel=1e-5)
    assert between == pytest.approx((0.94**-2 - 1.0) / 0.3 * closing, rel=0.15)
    assert far == 0.0


def test_distances_are_misjudged_by_a_lognormal_factor():
    m = one_ahead(80.0, effects=dataclasses.replace(CLEAR_MINDED, distance_error=True))
    for z in (-2.0, 0.0, 1.5):
        m.state.noise.distance_error = np.full_like(m.state.motion.s, z)
        gap = float(m.look().gap[LEADER, 0, 0])
        # A coefficient of variation of 0.10 by day.
        assert gap == pytest.approx(80.0 * math.exp(0.10 * z), rel=1e-5)


@pytest.mark.parametrize(
    ("weather", "spread"), [({}, 0.10), ({"night": 1.0}, 0.18), ({"fog": 80.0}, 0.25)]
)
def test_distances_are_harder_to_judge_at_night_and_in_fog(
    weather: dict[str, float], spread: float
):
    m = moment([Vehicle()], effects=EnabledEffects(), weather=weather)
    assert float(m.q.distance_error[0]) == pytest.approx(spread)
    assert float(m.q.speed_error[0]) == pytest.approx(0.20)


@pytest.mark.parametrize(
    ("gap", "change", "expected"),
    [
        (10.0, -3.0, -3.0),  # It looms: how hard it brakes is seen.
        (40.0, -1.0, -1.5),  # Stop lamps say that it brakes, not how hard.
        (40.0, -0.3, -0.3),  # Without lamps.
        (40.0, 2.0, 0.0),
    ],
)
@pytest.mark.parametrize("lane", [0, 1])
def test_the_braking_of_those_ahead_is_seen_but_not_their_accelerating(
    gap: float, change: float, expected: float, lane: int
):
    leader = Vehicle(s=gap + CAR, speed=20.0, lane=lane)
    effects = dataclasses.replace(CLEAR_MINDED, looming=True)
    m = moment([Vehicle(speed=20.0), leader], effects=effects)
    for _ in range(10):
        m.look()
        m.state.motion.vx[1] += np.float32(0.05 * change)
    seen = m.look().accel[LEFT_LEADER if lane else LEADER, 0, 0]
    assert float(seen) == pytest.approx(expected, rel=1e-4)


def test_errors_of_distance_fade_as_contact_comes_near():
    for closing, gap, share in ((0.0, 20.0, 1.0), (4.0, 20.0, 1.0), (10.0, 20.0, 0.5)):
        effects = dataclasses.replace(CLEAR_MINDED, distance_error=True)
        m = one_ahead(gap, speed=20.0 + closing, ahead=20.0, effects=effects)
        m.state.noise.distance_error = np.ones_like(m.state.motion.s)
        expected = gap * (1.0 + share * (math.exp(0.10) - 1.0))
        assert float(m.look().gap[LEADER, 0, 0]) == pytest.approx(expected, rel=1e-4)


def test_after_a_lane_change_a_known_neighbour_stays_known():
    m = moment(
        [Vehicle(s=0.0, lane=0), Vehicle(s=30.0, lane=1), Vehicle(s=-30.0, lane=1)],
        effects=DELAYED,
        road=wide_road(),
    )
    m.look()
    m.state.lane_choice.lane[0] += 1.0
    believed = m.look()
    assert bool(believed.is_detected[LEADER, 0, 0])
    assert bool(believed.is_detected[FOLLOWER, 0, 0])


def test_who_is_passed_stays_known_on_the_way_from_behind_to_ahead():
    # At night one glance of 0.5 s is not enough for what has not been seen before.
    m = moment(
        [Vehicle(s=0.0, lane=0), Vehicle(s=-1.0, lane=1), Vehicle(s=-80.0, lane=1)],
        effects=DELAYED,
        road=wide_road(),
        weather={"night": 1.0},
    )
    assert bool(m.look().is_detected[LEFT_FOLLOWER, 0, 0])
    m.state.motion.s[1] = 1.0
    believed = m.look()
    assert bool(believed.is_detected[LEFT_LEADER, 0, 0])
    # The one far behind was never nearest before: it takes its time to be noticed.
    assert not bool(believed.is_detected[LEFT_FOLLOWER, 0, 0])


def looks(m: Moment, decision: int) -> np.ndarray:
    return checks_mirrors_now(m.state, m.given, decision)


def test_everybody_looks_around_once_a_second_but_not_in_the_first_one():
    m = moment([Vehicle(s=100.0 * k) for k in range(8)])
    rows = np.array([looks(m, decision)[:, 0] for decision in range(100)])
    assert not rows[:20].any()
    for start in (20, 40, 60, 80):
        assert (rows[start : start + 20].sum(axis=0) == 1).all()
    assert rows.sum(axis=1).max() == 1  # One after the other.


def test_who_has_signalled_for_long_enough_looks_once_more_and_who_moves_over_looks_often():
    m = moment([Vehicle(), Vehicle(s=50.0, driver={"indicator_lead_time": 2.0})])
    m.state.lane_choice.wanted_side[1], m.state.lane_choice.time_wanted[1] = 1.0, 1.9
    assert not looks(m, 3).any()
    m.state.lane_choice.time_wanted[1] = 2.0
    assert [bool(one) for one in looks(m, 3)[:2, 0]] == [False, True]
    m.state.lane_choice.wanted_side[:] = 0.0
    m.state.path.elapsed[1], m.state.path.duration[1] = 1.0, 8.0
    assert [int(looks(m, k)[1, 0]) for k in range(21, 26)] == [0, 0, 0, 0, 1]


@pytest.mark.ci
def test_looks_over_the_shoulder_fail_in_the_share_of_the_trait():
    m = moment(*[[Vehicle(driver={"checks_blind_spot": 0.9})]] * 4000)
    share = m.state.lane_choice.checks_blind_spot[0].mean()
    assert share == pytest.approx(0.9, abs=4.0 * math.sqrt(0.9 * 0.1 / 4000))


def test_who_comes_near_from_the_side_is_noticed_without_a_look_over_the_shoulder():
    m = moment(
        [Vehicle(s=100.0, driver={"checks_blind_spot": 0.0}), Vehicle(s=97.0, lane=1)],
        road=wide_road(),
    )
    assert not bool(m.look().is_detected[LEFT_FOLLOWER, 0, 0])
    m.state.motion.d[0] += (
        m.state.motion.d[1, 0] - m.state.motion.d[0, 0] - np.float32(2.5)
    )  # 0.7 m between them.
    assert bool(m.look().is_detected[LEFT_FOLLOWER, 0, 0])
