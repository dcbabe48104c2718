"""Detection, delay and errors of perception: each effect alone, compared with published ranges."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from tests.support.traffic_instant import PERFECT_PERCEPTION, TrafficInstant, traffic_instant
from tests.support.worlds import Vehicle, wide_road

from overtaking.sim.reference.perception import checks_mirrors_now
from overtaking.sim.reference.state import FOLLOWER, LEADER, LEFT_FOLLOWER, LEFT_LEADER
from overtaking.world.constants import EnabledEffects

UNSEEN = 1000.0
CAR = 4.4  # Length of both cars [m].


def leader_ahead(
    distance: float, *, speed: float = 30.0, ahead: float = 20.0, **options
) -> TrafficInstant:
    """A car with a leader at a gap of `distance` [m]."""
    kind = options.pop("kind", "M")
    length = {"M": CAR, "T": 8.0}[kind]
    driver = options.pop("driver", {})
    leader = Vehicle(kind=kind, s=0.5 * (CAR + length) + distance, speed=ahead)
    return traffic_instant([Vehicle(speed=speed, driver=driver), leader], **options)


def is_leader_detected(instant: TrafficInstant, decisions: int = 1) -> bool:
    for _ in range(decisions - 1):
        instant.perceive()
    return bool(instant.perceive().is_detected[LEADER, 0, 0])


def detection_range(effects: EnabledEffects, weather: dict[str, float], **options) -> float:
    """Largest gap at which a leader is detected [m]."""
    low, high = 1.0, 20_000.0
    for _ in range(24):
        middle = 0.5 * (low + high)
        instant = leader_ahead(middle, speed=0.0, effects=effects, weather=weather, **options)
        low, high = (middle, high) if is_leader_detected(instant) else (low, middle)
    return low


ONLY_RANGE = dataclasses.replace(PERFECT_PERCEPTION, range=True)


def test_without_errors_of_perception_beliefs_are_true():
    instant = leader_ahead(80.0)
    beliefs = instant.perceive()
    assert bool(beliefs.is_detected[LEADER, 0, 0])
    assert float(beliefs.gap[LEADER, 0, 0]) == pytest.approx(80.0, abs=1e-4)
    assert float(beliefs.closing_speed[LEADER, 0, 0]) == pytest.approx(10.0, abs=1e-4)


def test_an_undetected_vehicle_is_believed_far_and_not_approaching():
    instant = leader_ahead(400.0, effects=ONLY_RANGE)
    beliefs = instant.perceive()
    assert not bool(beliefs.is_detected[LEADER, 0, 0])
    assert float(beliefs.gap[LEADER, 0, 0]) == UNSEEN
    assert float(beliefs.closing_speed[LEADER, 0, 0]) == 0.0


def test_attention_ends_at_300_m_ahead_and_at_150_m_in_the_mirror():
    assert detection_range(ONLY_RANGE, {}) == pytest.approx(300.0, abs=0.1)
    for gap, is_detected in ((149.0, True), (151.0, False)):
        cars = [Vehicle(s=500.0), Vehicle(s=500.0 - CAR - gap)]
        instant = traffic_instant(cars, effects=ONLY_RANGE)
        assert bool(instant.perceive().is_detected[FOLLOWER, 0, 0]) is is_detected


@pytest.mark.parametrize(("fog", "mor"), [(90.0, 85.0), (100.0, 50.0)])
def test_in_fog_by_day_the_range_of_an_unlit_car_follows_koschmieder(fog: float, mor: float):
    # The contrast 0.8 falls to 0.05 after ln(16) / beta; by day, lamps are seen less far than that.
    weather = {"fog": fog}
    beta = 3.0 / (10_000.0 * (50.0 / 10_000.0) ** (fog / 100.0))
    assert 3.0 / beta == pytest.approx(mor, rel=0.01)
    instant = leader_ahead(30.0, effects=ONLY_RANGE, weather=weather)
    instant.vehicles.inverse_tail_lamp[:] = 1e9  # All lamps off.
    visible_range = math.log(0.8 / 0.05) / beta
    for share, is_detected in ((0.98, True), (1.02, False)):
        instant.state.motion.s[1] = share * visible_range + CAR
        assert bool(instant.perceive().is_detected[LEADER, 0, 0]) is is_detected


@pytest.mark.ci
@pytest.mark.parametrize(("fog", "night", "metres"), [(100.0, 1.0, 154.0), (100.0, 0.0, 91.0)])
def test_in_fog_the_range_of_a_rear_fog_lamp_follows_allard(
    fog: float, night: float, metres: float
):
    # 200 cd; range computed by hand for a threshold of 8e-7 lx by night and 1e-4 lx by day.
    weather = {"fog": fog, "night": night, "sun_altitude": -1.0 if night else 1.0}
    assert detection_range(ONLY_RANGE, weather) == pytest.approx(metres, rel=0.01)


def test_a_braking_leader_is_seen_farther_in_fog_at_night():
    # 60 %: an extinction below that at which fog lamps are lit, so 8 cd against 100 cd.
    weather = {"fog": 85.0, "night": 1.0, "sun_altitude": -1.0}
    coasting = detection_range(ONLY_RANGE, weather)
    instant = leader_ahead(1.15 * coasting, speed=0.0, effects=ONLY_RANGE, weather=weather)
    assert not is_leader_detected(instant)
    instant.state.controls.requested_accel[1] = -3.0
    assert is_leader_detected(instant)


def test_spray_hides_a_lorry_on_a_wet_road():
    weather = {"rain": 100.0, "fog": 80.0}
    near = {"speed": 25.0, "ahead": 25.0, "kind": "T", "effects": ONLY_RANGE, "weather": weather}
    lorry = leader_ahead(30.0, **near)
    car = leader_ahead(30.0, **(near | {"kind": "M"}))
    for instant in (lorry, car):
        instant.vehicles.inverse_tail_lamp[:] = 1e9
    # A lorry throws up four times the spray of a car: 0.048 against 0.012 per metre.
    assert is_leader_detected(car)
    assert not is_leader_detected(lorry)


DELAYED = dataclasses.replace(PERFECT_PERCEPTION, delay=True)


@pytest.mark.parametrize(("night", "seconds"), [(0.0, 0.4), (1.0, 0.6)])
def test_a_new_vehicle_is_detected_after_the_detection_time(night: float, seconds: float):
    instant = traffic_instant(
        [Vehicle(s=0.0), Vehicle(s=30.0, lane=2)], effects=DELAYED, weather={"night": night}
    )
    instant.perceive()
    instant.state.motion.d[1] = instant.state.motion.d[
        0
    ]  # It appears near, without extra time for a far vehicle.
    instant.state.lane_choice.lane[1] = 0.0
    count = 0
    while not is_leader_detected(instant):
        count += 1
        assert count < 40
    assert count * 0.05 == pytest.approx(seconds, abs=0.051)


def test_vehicles_in_view_at_the_start_are_detected():
    assert is_leader_detected(leader_ahead(30.0, effects=DELAYED))


@pytest.mark.ci
@pytest.mark.parametrize("reaction", [0.5, 1.25])
def test_beliefs_extrapolate_the_state_of_one_reaction_time_ago(reaction: float):
    instant = leader_ahead(
        60.0, speed=20.0, ahead=20.0, driver={"reaction_time": reaction}, effects=DELAYED
    )
    num_delays = round(reaction * 20.0)
    for _ in range(40):
        instant.perceive()
        instant.advance()
    # The leader jumps ahead by 7 m and becomes 5 m/s slower; beliefs change a reaction time later.
    instant.state.motion.s[1] += 7.0
    instant.state.motion.vx[1] = 15.0
    gaps, closing_speeds = [], []
    for _ in range(num_delays + 2):
        beliefs = instant.perceive()
        gaps.append(float(beliefs.gap[LEADER, 0, 0]))
        closing_speeds.append(float(beliefs.closing_speed[LEADER, 0, 0]))
        instant.advance()
    np.testing.assert_allclose(gaps[:num_delays], 60.0, atol=1e-3)
    np.testing.assert_allclose(closing_speeds[:num_delays], 0.0, atol=1e-4)
    # Then the extrapolation is correct, because the leader keeps its speed.
    truth = float(instant.state.motion.s[1, 0] - instant.state.motion.s[0, 0]) - CAR + 0.05 * 5.0
    assert gaps[-1] == pytest.approx(truth, abs=1e-3)
    assert closing_speeds[-1] == pytest.approx(5.0, abs=1e-4)


def test_a_lorry_hides_the_car_before_it_from_a_follower_but_not_from_beside():
    occluded = dataclasses.replace(PERFECT_PERCEPTION, occlusion=True)
    # Seen from the follower, the lorry's corner hides the car in the next lane.
    cars = [
        Vehicle(s=0.0, lane=0),
        Vehicle(kind="T", s=20.0, lane=0),
        Vehicle(s=200.0, lane=1),
        Vehicle(s=60.0, lane=2),
    ]
    beliefs = traffic_instant(cars, effects=occluded).perceive()
    assert bool(beliefs.is_detected[LEADER, 0, 0])
    # The line of sight to 3.5 m aside at 200 m passes 0.3 m beside the lorry's axis: hidden.
    assert not bool(beliefs.is_detected[LEFT_LEADER, 0, 0])
    assert bool(
        traffic_instant(cars, effects=PERFECT_PERCEPTION).perceive().is_detected[LEFT_LEADER, 0, 0]
    )
    cars[1] = Vehicle(kind="M", s=20.0, lane=0)  # Drivers see over a car.
    assert bool(traffic_instant(cars, effects=occluded).perceive().is_detected[LEFT_LEADER, 0, 0])


@pytest.mark.parametrize("checks", [0.0, 1.0])
def test_only_a_shoulder_check_reveals_the_blind_spot(checks: float):
    beside = [
        Vehicle(s=100.0, driver={"checks_blind_spot": checks}),
        Vehicle(s=97.0, lane=1),
    ]
    beliefs = traffic_instant(beside).perceive()
    assert bool(beliefs.is_detected[LEFT_FOLLOWER, 0, 0]) is bool(checks)
    behind = [beside[0], Vehicle(s=100.0 - CAR - 6.0, lane=1)]
    assert bool(
        traffic_instant(behind).perceive().is_detected[LEFT_FOLLOWER, 0, 0]
    )  # The mirror shows this vehicle.


# Gap at which the looming rate of an approached vehicle is 0.003 rad/s: sqrt(w dv / 0.003).
LOOMING = [("M", 5.0, 55.0), ("M", 10.0, 77.0), ("M", 20.0, 110.0), ("T", 20.0, 129.0)]


@pytest.mark.parametrize(("kind", "closing", "metres"), LOOMING)
def test_a_closing_speed_is_perceived_from_the_looming_threshold_on(
    kind: str, closing: float, metres: float
):
    looming = dataclasses.replace(PERFECT_PERCEPTION, looming=True)
    closing_speeds: list[float] = []
    # Perceived in full at 1.3 times the threshold, which is at 0.877 times the gap.
    for share in (0.86, 0.94, 1.03):
        instant = leader_ahead(
            share * metres, speed=30.0, ahead=30.0 - closing, kind=kind, effects=looming
        )
        beliefs = instant.perceive()
        assert bool(beliefs.is_detected[LEADER, 0, 0])
        closing_speeds.append(float(beliefs.closing_speed[LEADER, 0, 0]))
    near, between, far = closing_speeds
    assert near == pytest.approx(closing, rel=1e-5)
    assert between == pytest.approx((0.94**-2 - 1.0) / 0.3 * closing, rel=0.15)
    assert far == 0.0


def test_distances_are_misjudged_by_a_lognormal_factor():
    instant = leader_ahead(
        80.0, effects=dataclasses.replace(PERFECT_PERCEPTION, distance_error=True)
    )
    for z in (-2.0, 0.0, 1.5):
        instant.state.noise.distance_error = np.full_like(instant.state.motion.s, z)
        gap = float(instant.perceive().gap[LEADER, 0, 0])
        # A coefficient of variation of 0.10 by day.
        assert gap == pytest.approx(80.0 * math.exp(0.10 * z), rel=1e-5)


@pytest.mark.parametrize(
    ("weather", "spread"), [({}, 0.10), ({"night": 1.0}, 0.18), ({"fog": 80.0}, 0.25)]
)
def test_distances_are_harder_to_judge_at_night_and_in_fog(
    weather: dict[str, float], spread: float
):
    instant = traffic_instant([Vehicle()], effects=EnabledEffects(), weather=weather)
    assert float(instant.simulations.distance_error[0]) == pytest.approx(spread)
    assert float(instant.simulations.speed_error[0]) == pytest.approx(0.20)


@pytest.mark.parametrize(
    ("gap", "change", "expected"),
    [
        (10.0, -3.0, -3.0),  # It looms: the driver perceives its braking.
        (40.0, -1.0, -1.5),  # Only the stop lamps show braking: the assumed value.
        (40.0, -0.3, -0.3),  # Without lamps.
        (40.0, 2.0, 0.0),
    ],
)
@pytest.mark.parametrize("lane", [0, 1])
def test_drivers_perceive_braking_ahead_but_not_acceleration(
    gap: float, change: float, expected: float, lane: int
):
    leader = Vehicle(s=gap + CAR, speed=20.0, lane=lane)
    effects = dataclasses.replace(PERFECT_PERCEPTION, looming=True)
    instant = traffic_instant([Vehicle(speed=20.0), leader], effects=effects)
    for _ in range(10):
        instant.perceive()
        instant.state.motion.vx[1] += np.float32(0.05 * change)
    is_leader_detected = instant.perceive().accel[LEFT_LEADER if lane else LEADER, 0, 0]
    assert float(is_leader_detected) == pytest.approx(expected, rel=1e-4)


def test_errors_of_distance_fade_as_contact_comes_near():
    for closing, gap, share in ((0.0, 20.0, 1.0), (4.0, 20.0, 1.0), (10.0, 20.0, 0.5)):
        effects = dataclasses.replace(PERFECT_PERCEPTION, distance_error=True)
        instant = leader_ahead(gap, speed=20.0 + closing, ahead=20.0, effects=effects)
        instant.state.noise.distance_error = np.ones_like(instant.state.motion.s)
        expected = gap * (1.0 + share * (math.exp(0.10) - 1.0))
        assert float(instant.perceive().gap[LEADER, 0, 0]) == pytest.approx(expected, rel=1e-4)


def test_a_detected_neighbour_stays_detected_after_a_lane_change():
    instant = traffic_instant(
        [Vehicle(s=0.0, lane=0), Vehicle(s=30.0, lane=1), Vehicle(s=-30.0, lane=1)],
        effects=DELAYED,
        road=wide_road(),
    )
    instant.perceive()
    instant.state.lane_choice.lane[0] += 1.0
    beliefs = instant.perceive()
    assert bool(beliefs.is_detected[LEADER, 0, 0])
    assert bool(beliefs.is_detected[FOLLOWER, 0, 0])


def test_a_passing_vehicle_stays_detected_from_behind_to_ahead():
    # At night one glance of 0.5 s is too short to detect a new vehicle.
    instant = traffic_instant(
        [Vehicle(s=0.0, lane=0), Vehicle(s=-1.0, lane=1), Vehicle(s=-80.0, lane=1)],
        effects=DELAYED,
        road=wide_road(),
        weather={"night": 1.0},
    )
    assert bool(instant.perceive().is_detected[LEFT_FOLLOWER, 0, 0])
    instant.state.motion.s[1] = 1.0
    beliefs = instant.perceive()
    assert bool(beliefs.is_detected[LEFT_LEADER, 0, 0])
    # The vehicle far behind was in no role before, so its detection takes time.
    assert not bool(beliefs.is_detected[LEFT_FOLLOWER, 0, 0])


def mirror_checks(instant: TrafficInstant, decision: int) -> np.ndarray:
    return checks_mirrors_now(instant.state, instant.params, decision)


def test_drivers_check_mirrors_once_a_second_but_not_in_the_first_second():
    instant = traffic_instant([Vehicle(s=100.0 * k) for k in range(8)])
    rows = np.array([mirror_checks(instant, decision)[:, 0] for decision in range(100)])
    assert not rows[:20].any()
    for start in (20, 40, 60, 80):
        assert (rows[start : start + 20].sum(axis=0) == 1).all()
    assert rows.sum(axis=1).max() == 1  # One after the other.


def test_drivers_check_mirrors_once_more_before_and_often_during_a_lane_change():
    instant = traffic_instant([Vehicle(), Vehicle(s=50.0, driver={"indicator_lead_time": 2.0})])
    instant.state.lane_choice.wanted_side[1], instant.state.lane_choice.time_wanted[1] = 1.0, 1.9
    assert not mirror_checks(instant, 3).any()
    instant.state.lane_choice.time_wanted[1] = 2.0
    assert mirror_checks(instant, 3)[:2, 0].tolist() == [False, True]
    instant.state.lane_choice.wanted_side[:] = 0.0
    instant.state.path.elapsed[1], instant.state.path.duration[1] = 1.0, 8.0
    assert [int(mirror_checks(instant, k)[1, 0]) for k in range(21, 26)] == [0, 0, 0, 0, 1]


@pytest.mark.ci
def test_shoulder_checks_are_left_out_in_the_share_of_the_trait():
    instant = traffic_instant(*[[Vehicle(driver={"checks_blind_spot": 0.9})]] * 4000)
    share = instant.state.lane_choice.checks_blind_spot[0].mean()
    assert share == pytest.approx(0.9, abs=4.0 * math.sqrt(0.9 * 0.1 / 4000))


def test_a_near_vehicle_beside_is_detected_without_a_shoulder_check():
    instant = traffic_instant(
        [Vehicle(s=100.0, driver={"checks_blind_spot": 0.0}), Vehicle(s=97.0, lane=1)],
        road=wide_road(),
    )
    assert not bool(instant.perceive().is_detected[LEFT_FOLLOWER, 0, 0])
    instant.state.motion.d[0] += (
        instant.state.motion.d[1, 0] - instant.state.motion.d[0, 0] - np.float32(2.5)
    )  # A lateral gap of 0.7 m.
    assert bool(instant.perceive().is_detected[LEFT_FOLLOWER, 0, 0])
