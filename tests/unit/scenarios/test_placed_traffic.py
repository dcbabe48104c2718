"""Starts: who is where, how fast, and whether braking can save everyone.

The check of the braking is made here a second time, in float64 and step by step, with a friction
table and a film of water typed from their sources, so that it shares no line with the sampler.
"""

import dataclasses

import numpy as np
import pytest
from scipy import interpolate, stats

from overtaking.core.errors import ConfigError, InfeasibleError
from overtaking.model.known_roads import known_road
from overtaking.model.vehicles import VehicleKind
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource

SMALLEST_P = 1e-3
KMH = 3.6
ROUNDING = 1e-3  # Metres: float32 positions a few hundred metres along the road.

# Bosch Automotive Handbook: static friction of new and worn car tyres, 50, 90 and 130 km/h by dry,
# wet (0.2 mm), heavy rain (1 mm) and puddles (2 mm).
BOSCH_SPEEDS, BOSCH_FILMS = [50 / KMH, 90 / KMH, 130 / KMH], [0.0, 0.2, 1.0, 2.0]
BOSCH_NEW = [[0.85, 0.65, 0.55, 0.50], [0.80, 0.60, 0.30, 0.05], [0.75, 0.55, 0.20, 0.00]]
BOSCH_WORN = [[1.00, 0.50, 0.40, 0.25], [0.95, 0.20, 0.10, 0.05], [0.90, 0.20, 0.10, 0.00]]


def pairs_in_lanes(batch):
    """Each vehicle with the next ahead in its lane, as flat arrays of (simulation, rear, front)."""
    s = np.where(batch.vehicles.valid, batch.start_s, np.nan).astype(np.float64)
    found = []
    for rear in range(batch.num_slots):
        ahead = s - s[:, [rear]]
        lane = batch.start_lane == batch.start_lane[:, [rear]]
        ahead = np.where(lane & (ahead >= 0), ahead, np.inf)
        ahead[:, rear] = np.inf
        front = np.argmin(ahead, axis=1)
        here = np.isfinite(np.min(ahead, axis=1)) & batch.vehicles.valid[:, rear]
        rows = np.flatnonzero(here)
        found.append(np.stack([rows, np.full(rows.size, rear), front[rows]]))
    return np.concatenate(found, axis=1)


def gaps(batch, pairs):
    row, rear, front = pairs
    half = 0.5 * batch.vehicles.length.astype(np.float64)
    s = batch.start_s.astype(np.float64)
    return s[row, front] - s[row, rear] - half[row, front] - half[row, rear]


def lowest_speed_ahead(batch, pairs):
    """Lowest speed of all that are ahead of the follower in its lane."""
    row, rear, _ = pairs
    ahead = batch.start_s[row] > batch.start_s[row, rear][:, None]
    ahead &= batch.vehicles.valid[row]
    ahead &= batch.start_lane[row] == batch.start_lane[row, rear][:, None]
    return np.where(ahead, batch.start_speed[row].astype(np.float64), np.inf).min(axis=1)


def usable_decel(batch, pairs):
    """0.7 of the friction at the starting speed, limited by the brakes."""
    row, rear, _ = pairs
    weather, vehicles = batch.weather, batch.vehicles
    rain = 50.0 * (weather.rain[row].astype(np.float64) / 100) ** 2.5
    puddles = weather.puddles[row].astype(np.float64)
    path = 3.5 * (batch.road.num_lanes - batch.start_lane[row, rear] - 0.5)
    film = 0.01485 * 0.9**0.11 * path**0.43 * rain**0.59 / 0.025**0.42 - 0.9
    film = np.maximum(film, np.where((rain > 0) | (puddles >= 25), 0.2, 0.0))
    deep = film + 2.0 * np.clip(puddles - 50, 0, None) / 50
    cover = 0.5 * puddles / 100
    speed = batch.start_speed[row, rear].astype(np.float64)
    wear = vehicles.tyre_wear[row, rear].astype(np.float64)
    truck = vehicles.kind[row, rear] == VehicleKind.TRUCK
    thin, thick = (
        (1 - wear) * bosch(BOSCH_NEW, speed, h, truck) + wear * bosch(BOSCH_WORN, speed, h, truck)
        for h in (film, deep)
    )
    mean = (1 - cover) * np.maximum(thin, 0.05) + cover * np.maximum(thick, 0.05)
    return np.minimum(0.7 * 9.81 * mean, vehicles.peak_decel[row, rear])


def bosch(table, speed, film, truck):
    """Friction in the table; a truck has 0.85 of it when dry and half of the loss on deep water."""
    slowest = np.array(table)[0]
    for_trucks = np.array(table)
    for_trucks[:, 0] *= 0.85
    for_trucks[:, 2:] = slowest[2:] + 0.5 * (for_trucks[:, 2:] - slowest[2:])
    within = np.clip(speed, BOSCH_SPEEDS[0], BOSCH_SPEEDS[-1]), np.clip(film, 0.0, 2.0)
    points = np.stack(within, axis=-1)
    of_car, of_truck = (
        interpolate.RegularGridInterpolator((BOSCH_SPEEDS, BOSCH_FILMS), values)(points)
        for values in (table, for_trucks)
    )
    return np.where(truck, of_truck, of_car)


def smallest_gap_while_braking(batch, pairs, step=0.05):
    """Smallest gap when the leader brakes hard to the lowest speed ahead, then the follower."""
    row, rear, front = pairs
    final = lowest_speed_ahead(batch, pairs)
    lead = batch.start_speed[row, front].astype(np.float64)
    own = batch.start_speed[row, rear].astype(np.float64)
    gap = gaps(batch, pairs)
    reaction = batch.drivers.reaction_time[row, rear].astype(np.float64)
    decel = usable_decel(batch, pairs)
    smallest = gap.copy()
    for number in range(round(120 / step)):
        braking = np.clip(((number + 1) * step - reaction) / step, 0.0, 1.0)
        next_lead = np.maximum(lead - 9.0 * step, np.minimum(lead, final))
        next_own = np.maximum(own - braking * decel * step, np.minimum(own, final))
        gap += 0.5 * step * (lead + next_lead - own - next_own)
        lead, own = next_lead, next_own
        smallest = np.minimum(smallest, gap)
        if np.all(own <= lead):
            break
    else:
        pytest.fail("someone is still closing in after two minutes")
    return smallest


def test_the_number_of_vehicles_is_uniform_and_they_come_first(pinto):
    assert stats.chisquare(np.bincount(pinto.num_vehicles)[2:]).pvalue > SMALLEST_P
    assert (pinto.num_vehicles.min(), pinto.num_vehicles.max()) == (2, 6)
    first = np.arange(pinto.num_slots) < pinto.num_vehicles[:, None]
    np.testing.assert_array_equal(pinto.vehicles.valid, first)


def test_the_ego_starts_in_every_lane_but_the_fastest(pinto):
    counts = np.bincount(pinto.start_lane[:, 0], minlength=5)
    assert counts[4] == 0
    assert stats.chisquare(counts[:4]).pvalue > SMALLEST_P


def test_the_others_are_in_every_lane(pinto):
    others = pinto.start_lane[:, 2:][pinto.vehicles.valid[:, 2:]]
    assert stats.chisquare(np.bincount(others)).pvalue > SMALLEST_P


def test_slot_1_is_the_next_ahead_of_the_ego(pinto):
    row, rear, front = pairs_in_lanes(pinto)
    of_ego = rear == 0
    assert of_ego.sum() == pinto.num_simulations
    assert np.all(front[of_ego] == 1)
    np.testing.assert_array_equal(row[of_ego], np.arange(pinto.num_simulations))


def test_starts_lie_in_the_zone_of_the_study(pinto):
    valid = pinto.vehicles.valid
    centres = pinto.road.lane_centres[np.minimum(pinto.start_lane, 4)]
    x, y = pinto.road.to_world(pinto.start_s, centres)
    assert x[valid].min() > 320 - 0.01
    assert x[valid].max() < 450 + 0.01
    # Lane centres are 1.4 to 2.4 m from the middle of the study's lanes, which it calls 238 to 258.
    assert np.all((-y[valid] > 237) & (-y[valid] < 258))


def test_nobody_starts_on_another(pinto):
    assert gaps(pinto, pairs_in_lanes(pinto)).min() >= 10.0 - ROUNDING


def test_speeds_are_those_that_vehicles_may_come_with(pinto):
    speed = pinto.start_speed * KMH
    valid = pinto.vehicles.valid
    assert speed[valid].min() > 50 - 1e-3
    assert speed[valid].max() < 120 + 1e-3
    trucks = valid & (pinto.vehicles.kind == VehicleKind.TRUCK)
    assert speed[trucks].max() < 90 + 1e-3


def test_mean_speeds_and_distance_are_near_those_of_the_study(pinto):
    # SP 57 to 64 km/h and SE 55 to 88 km/h by class; the class means weighted by their sizes give
    # 62 and 80. The distance of the centres is 31.5 to 55.8 m by class. The exponent of
    # the leaders' speeds was fitted to the means by class, not to that of all.
    own, lead = (pinto.start_speed[:, slot].mean() * KMH for slot in (0, 1))
    assert lead == pytest.approx(50 + 40 / 4.4, abs=0.5)
    assert lead == pytest.approx(62, abs=4)
    assert own == pytest.approx(80, abs=2)
    distance = (pinto.start_s[:, 1] - pinto.start_s[:, 0]).mean()
    assert 31.5 < distance < 55.8
    slow = np.mean(pinto.start_speed[:, 1] * KMH < 55)
    assert slow == pytest.approx((5 / 40) ** (1 / 3.4), abs=0.01)


def test_undisturbed_speeds_are_uniform(pinto):
    valid = pinto.vehicles.valid.copy()
    valid[:, :2] = False  # The leader's are skewed and the ego has one.
    row, rear, _ = pairs_in_lanes(pinto)
    valid[row, rear] = False
    cars = valid & (pinto.vehicles.kind != VehicleKind.TRUCK)
    speeds = pinto.start_speed[cars] * KMH
    assert stats.kstest(speeds, stats.uniform(50, 70).cdf).pvalue > SMALLEST_P


def test_no_start_is_doomed(pinto):
    pairs = pairs_in_lanes(pinto)
    assert smallest_gap_while_braking(pinto, pairs).min() > 0.5


def test_starts_as_drawn_are_often_doomed_so_the_check_can_fail(town06):
    chosen = load_specification("pinto2023-physical", {"starts.allow_doomed": True})
    drawn = ScenarioSource(chosen, town06, seed=2023).sample(np.arange(5_000))
    pairs = pairs_in_lanes(drawn)
    assert np.mean(smallest_gap_while_braking(drawn, pairs) < 0.0) > 0.05
    assert gaps(drawn, pairs).min() >= 10.0 - ROUNDING


def test_repairs_spare_who_is_alone_in_a_lane(town06):
    drawn = ScenarioSource(
        load_specification("pinto2023-physical", {"starts.allow_doomed": True}), town06, seed=4
    ).sample(np.arange(5_000))
    settled = ScenarioSource(load_specification("pinto2023-physical"), town06, seed=4).sample(
        np.arange(5_000)
    )
    alone = drawn.vehicles.valid.copy()
    row, rear, front = pairs_in_lanes(drawn)
    alone[row, rear] = alone[row, front] = False
    assert alone.sum() > 1_000
    np.testing.assert_array_equal(drawn.start_s[alone], settled.start_s[alone])
    np.testing.assert_array_equal(drawn.start_speed[alone], settled.start_speed[alone])


def test_repairs_only_slow_down(town06):
    drawn = ScenarioSource(
        load_specification("pinto2023-physical", {"starts.allow_doomed": True}), town06, seed=4
    ).sample(np.arange(5_000))
    settled = ScenarioSource(load_specification("pinto2023-physical"), town06, seed=4).sample(
        np.arange(5_000)
    )
    assert np.all(settled.start_speed <= drawn.start_speed)
    assert np.all(settled.start_s <= drawn.start_s + ROUNDING)
    np.testing.assert_array_equal(settled.start_lane, drawn.start_lane)


def test_starts_do_not_pile_up_at_the_end_of_the_zone(pinto):
    valid = pinto.vehicles.valid
    first_metre = np.mean(pinto.start_s[valid] < pinto.start_s[valid].min() + 1.0)
    assert first_metre < 3 / 130


@pytest.mark.parametrize("zone", ["100..300", "100..200"])
def test_eight_vehicles_find_room_where_a_lane_does_not_hold_them(town06, zone):
    chosen = load_specification(
        "pinto2023-physical",
        {"traffic.vehicles": "8..8", "traffic.spawn_s_m": zone, "traffic.types": "{T=3, S=1}"},
    )
    drawn = ScenarioSource(chosen, town06, seed=6).sample(np.arange(3_000))
    pairs = pairs_in_lanes(drawn)
    assert drawn.num_vehicles.min() == 8
    assert gaps(drawn, pairs).min() >= 10.0 - ROUNDING
    low, high = (float(end) for end in zone.split(".."))
    assert low - ROUNDING < drawn.start_s.min()
    assert drawn.start_s.max() < high + ROUNDING
    assert np.all(pairs[2][pairs[1] == 0] == 1)
    assert smallest_gap_while_braking(drawn, pairs).min() > 0.5


def test_a_full_lane_sends_the_next_one_elsewhere(town06):
    chosen = load_specification(
        "pinto2023-physical",
        {
            "traffic.vehicles": "8..8",
            "traffic.spawn_s_m": "100..125",
            "traffic.types": "T",
            "starts.min_gap_m": 10.0,
        },
    )
    drawn = ScenarioSource(chosen, town06, seed=6).sample(np.arange(500))
    in_lane = np.stack([(drawn.start_lane == lane).sum(axis=1) for lane in range(5)])
    assert in_lane.max() == 2
    assert np.all(drawn.start_lane[:, 0] == drawn.start_lane[:, 1])


def test_what_cannot_be_placed_is_infeasible(town06):
    crowd = {"traffic.vehicles": "8..8", "traffic.types": "T", "traffic.spawn_s_m": "100..120"}
    with pytest.raises(InfeasibleError, match=r"traffic\.vehicles: .* ask for fewer vehicles"):
        ScenarioSource(
            load_specification("pinto2023-physical", crowd | {"starts.min_gap_m": 15}),
            town06,
            seed=1,
        ).sample([0])
    nowhere = {"traffic.spawn_s_m": "100..100", "traffic.vehicles": "2..2"}
    with pytest.raises(InfeasibleError, match="ask for fewer"):
        ScenarioSource(load_specification("pinto2023-physical", nowhere), town06, seed=1).sample(
            [0]
        )


def test_a_truck_cannot_come_faster_than_its_governor(town06):
    fast = {"traffic.speed_kmh": "100..120"}
    with pytest.raises(InfeasibleError, match="type T reaches, 90 km/h"):
        ScenarioSource(load_specification("pinto2023-physical", fast), town06, seed=1).sample([0])
    without = fast | {"traffic.types.T": "0", "traffic.ego_types.T": "0"}
    assert (
        ScenarioSource(load_specification("pinto2023-physical", without), town06, seed=1)
        .sample([0])
        .num_simulations
        == 1
    )


def test_a_zone_off_the_road_is_refused(town06):
    with pytest.raises(ConfigError, match=r"spawn_s_m: .* --set traffic\.spawn_s_m=5\.\.105"):
        ScenarioSource(
            load_specification("pinto2023-physical", {"traffic.spawn_s_m": "0..100"}),
            town06,
            seed=1,
        ).sample([0])
    with pytest.raises(ConfigError, match="spawn_x_m"):
        ScenarioSource(
            load_specification("pinto2023-physical", {"traffic.spawn_x_m": "500..700"}),
            town06,
            seed=1,
        ).sample([0])


def test_a_zone_for_another_road_is_refused_with_one_that_fits(town06):
    other = dataclasses.replace(town06, x0=town06.x0 + 5000.0)
    with pytest.raises(ConfigError) as caught:
        ScenarioSource(load_specification("pinto2023-physical"), other, seed=1).sample([0])
    key, zone = str(caught.value).rsplit("add --set ", 1)[1].split("=")
    assert zone == "5..135"
    assert (
        ScenarioSource(load_specification("pinto2023-physical", {key: zone}), other, seed=1)
        .sample([0])
        .num_simulations
        == 1
    )


def test_the_lanes_of_a_road_are_looked_at_before_its_length(town06):
    narrow = dataclasses.replace(town06, lanes=town06.lanes[:1], length=20.0)
    with pytest.raises(ConfigError, match="a road with at least two lanes, got 1 lane"):
        ScenarioSource(load_specification("pinto2023-physical"), narrow, seed=1).sample([0])


def test_the_fastest_lane_is_refused_to_the_ego(town06):
    with pytest.raises(ConfigError, match="0 to 3, got \\[2, 4\\]; leave out the fastest lane"):
        ScenarioSource(
            load_specification("pinto2023-physical", {"traffic.ego_lanes": "[2, 4]"}),
            town06,
            seed=1,
        ).sample([0])
    chosen = load_specification("pinto2023-physical", {"traffic.ego_lanes": "[1, 3]"})
    assert set(ScenarioSource(chosen, town06, seed=1).sample(np.arange(200)).start_lane[:, 0]) == {
        1,
        3,
    }


def test_the_road_reaches_as_far_as_anyone_can_drive(pinto, town06):
    fastest = np.where(pinto.vehicles.valid, pinto.drivers.desired_speed, 0.0).max()
    assert pinto.road.length > pinto.start_s.max() + 1.1 * fastest * pinto.horizon.max()
    assert pinto.road == town06.extend_to(pinto.road.length)


def test_other_roads_and_their_mirror_images_work():
    motorway = known_road("motorway")
    chosen = load_specification("pinto2023-physical", {"traffic.spawn_s_m": "50..180"})
    here = ScenarioSource(chosen, motorway, seed=1).sample(np.arange(300))
    there = ScenarioSource(chosen, motorway.mirror(), seed=1).sample(np.arange(300))
    assert here.start_lane[here.vehicles.valid].max() == motorway.num_lanes - 1
    np.testing.assert_array_equal(here.start_s, there.start_s)
    np.testing.assert_array_equal(here.start_speed, there.start_speed)
