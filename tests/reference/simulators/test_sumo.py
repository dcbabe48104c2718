"""Our scenarios on the real SUMO: starts, formulas that SUMO publishes, and determinism."""

from __future__ import annotations

import subprocess
import sys
import threading

import numpy as np
import pytest
from tests.reference.scenes import limited
from tests.reference.test_bends import BENDS, HILLS, on
from tests.support.sumo import needs_sumo
from tests.support.two_way import pair
from tests.support.two_way import road as two_way_road
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking.core.errors import ConfigError, MissingExtraError
from overtaking.model.known_roads import known_road
from overtaking.model.road_course import SpeedLimitSpan
from overtaking.model.trajectories import NO_VEHICLE, Stage
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine
from overtaking.simulators.sumo import run as sumo
from overtaking.simulators.sumo import traffic
from overtaking.simulators.sumo.library import library, running
from overtaking.simulators.sumo.network import network

pytestmark = needs_sumo

STAYS = {"min_speed_gain": 1e6, "indicator_lead_time": 1.0}
OVERTAKES = {"desired_speed": 33.0, "min_speed_gain": 1.0, "lane_change_duration": 5.0}


def sampled(count, seed=1, first=0):
    index = np.arange(first, first + count, dtype=np.uint64)
    specification = load_specification("pinto2023-physical")
    return ScenarioSource(specification, known_road(specification.road), seed).sample(index)


def metres(values):
    return values.astype(np.float64) * 1e-3


@pytest.fixture(scope="module")
def batch():
    return sumo.simulate(sampled(12))


@pytest.fixture
def without_errors(monkeypatch):
    """Drivers without errors of perception, which formulas can describe."""
    quiet = {"sigmagap": 0.0, "sigmaleader": 0.0, "sigmaerror": 0.0}
    following = traffic._following
    monkeypatch.setattr(traffic, "_following", lambda *arguments: following(*arguments) | quiet)


# --- inputs and outputs ---


def test_the_first_frame_is_the_start_of_the_scenario(batch):
    engine_states = engine.simulate(batch.scenario).states
    valid = batch.scenario.vehicles.valid
    for name in ("x", "y", "s", "d", "speed", "heading", "lane"):
        sumo_values = getattr(batch.states, name)[:, :, 0][valid].astype(int)
        engine_values = getattr(engine_states, name)[:, :, 0][valid].astype(int)
        assert np.abs(sumo_values - engine_values).max() <= 1, name


def test_the_network_in_sumo_has_our_lanes_and_limits(tmp_path):
    road = known_road("town06")
    with running_network(road, tmp_path) as library_of_network:
        lane = library_of_network.lane
        names = [f"road_{k}" for k in range(road.num_lanes)]
        assert [lane.getWidth(name) for name in names] == [
            our_lane.width for our_lane in road.lanes
        ]
        limits = [lane.getMaxSpeed(name) for name in names]
        assert limits == pytest.approx([road.speed_limit] * road.num_lanes)
        middles = [lane.getShape(name)[0][1] for name in names]
        assert middles == pytest.approx((road.overtaking_sign * road.lane_centres).tolist())


def running_network(road, folder):
    net = folder / "road.net.xml"
    net.write_text(network(road, 1000.0, [1.0] * road.num_lanes), encoding="utf-8")
    return running(["--net-file", str(net), "--no-step-log", "true"])


def test_speeds_are_in_metres_per_second(without_errors):
    world = scenario([Vehicle(speed=25.0, driver=STAYS | {"desired_speed": 25.0})], horizon=10.0)
    run = sumo.simulate(world).states
    speed = metres(run.speed[0, 0])
    assert speed == pytest.approx(25.0, abs=0.01)
    assert metres(run.s[0, 0, 200] - run.s[0, 0, 0]) == pytest.approx(250.0, abs=0.05)


def test_recorded_speed_is_the_derivative_of_recorded_position(batch):
    for row in range(3):
        count = batch.num_frames[row]
        speed_along = np.diff(metres(batch.states.s[row, 0, :count])) / 0.05
        speed = metres(batch.states.speed[row, 0, 1:count])
        speed_across = np.diff(metres(batch.states.d[row, 0, :count])) / 0.05
        assert np.hypot(speed_along, speed_across) == pytest.approx(speed, abs=0.06)


# --- formulas ---


@pytest.mark.parametrize(("time_gap", "min_gap"), [(1.0, 2.0), (1.6, 3.0)])
@pytest.mark.parametrize("speed", [15.0, 22.0])
def test_followers_keep_the_equilibrium_gap_of_the_model(time_gap, min_gap, speed, without_errors):
    """s0 + v T of the IIDM (Treiber and Kesting 2013, section 11.3.7).

    The EIDM's source adds 5 cm to s0 and takes 25 cm off the gap that the driver sees.
    """
    follows = STAYS | {"desired_speed": 30.0, "time_gap": time_gap, "min_gap": min_gap}
    leads = STAYS | {"desired_speed": speed}
    begin = [
        Vehicle(s=0.0, speed=speed, driver=follows),
        Vehicle(s=60.0, speed=speed, driver=leads),
    ]
    world = scenario(begin, horizon=60.0)
    run = sumo.simulate(world)
    gap = metres(run.states.s[0, 1] - run.states.s[0, 0]) - world.vehicles.length[0, :2].mean()
    assert gap[-1] == pytest.approx(min_gap + speed * time_gap + 0.30, abs=0.05)
    assert metres(run.states.speed[0, 0, -1]) == pytest.approx(speed, abs=0.05)


@pytest.mark.ci
def test_errors_of_judgement_scatter_the_gap_around_the_equilibrium():
    follows = STAYS | {"desired_speed": 30.0, "time_gap": 1.4, "min_gap": 2.0}
    begin = [
        Vehicle(s=0.0, speed=20.0, driver=follows),
        Vehicle(s=37.0, speed=20.0, driver=STAYS | {"desired_speed": 20.0}),
    ]
    world = scenario(*[begin] * 12, weather={"night": 1.0}, horizon=30.0)
    run = sumo.simulate(world)
    gap = metres(run.states.s[:, 1] - run.states.s[:, 0]) - world.vehicles.length[0, :2].mean()
    late = gap[:, 300:]
    assert late.mean() == pytest.approx(30.3, rel=0.15)
    assert late[:, -1].std() > 1.0


@pytest.mark.parametrize("rain", [15.0, 60.0, 100.0])
def test_a_wet_road_slows_vehicles_by_the_published_share(rain, without_errors):
    """The polynomial of the page Simulation/Friction of SUMO's documentation."""
    begin = [Vehicle(speed=25.0, driver=STAYS | {"desired_speed": 30.0})]
    world = scenario(begin, weather={"rain": rain}, horizon=40.0)
    friction = float(traffic.Traffic.of(world).friction[0, 0])
    share = -0.3491 * friction**2 + 0.8922 * friction + 0.4493
    speed = metres(sumo.simulate(world).states.speed[0, 0, -1])
    assert speed == pytest.approx(30.0 * share, rel=0.005)
    assert share < 0.9


@pytest.mark.parametrize(("model", "is_slower"), [("EIDM", False), ("Krauss", True)])
def test_the_eidm_ignores_the_friction_device_of_sumo(model, is_slower, tmp_path):
    road = wide_road(limit=30.0)
    net, demand = tmp_path / "road.net.xml", tmp_path / "one.rou.xml"
    net.write_text(network(road, 2000.0, [0.5] * 3), encoding="utf-8")
    demand.write_text(
        f'<routes><vType id="t" carFollowModel="{model}" laneChangeModel="SL2015" speedDev="0"'
        ' sigma="0"><param key="has.friction.device" value="true"/>'
        '<param key="device.friction.stdDev" value="0"/></vType><route id="r" edges="road"/>'
        '<vehicle id="0" type="t" route="r" depart="0" departSpeed="20"/></routes>',
        encoding="utf-8",
    )
    files_and_step = {"net-file": net, "route-files": demand, "step-length": 0.05}
    options = [f"--{key}={value}" for key, value in files_and_step.items()]
    with running([*options, "--lateral-resolution=0.5", "--no-step-log=true"]) as simulation:
        for _ in range(600):
            simulation.simulationStep()
        speed = simulation.vehicle.getSpeed("0")
    assert (speed < 25.0) == is_slower


@pytest.mark.parametrize("duration", [3.0, 6.0])
def test_a_lane_change_takes_the_time_of_the_driver(duration, without_errors):
    driver = OVERTAKES | {"lane_change_duration": duration}
    begin = [
        Vehicle(s=0.0, speed=30.0, driver=driver),
        Vehicle(s=70.0, speed=18.0, driver=STAYS | {"desired_speed": 18.0}),
    ]
    run = sumo.simulate(scenario(begin, road=wide_road(), horizon=15.0))
    d = metres(run.states.d[0, 0])
    moving = np.flatnonzero(np.abs(np.diff(d)) > 1e-4)
    out = moving[: np.argmax(np.diff(moving, append=10**6) > 5) + 1]
    assert d[out[-1] + 1] - d[out[0]] == pytest.approx(3.5, abs=0.02)
    # The lane change starts and ends slower than a recorded millimetre per frame, and sometimes has
    # two steps.
    assert 0.05 * len(out) == pytest.approx(duration, abs=0.4)


# --- events ---


def test_an_eager_driver_overtakes_and_returns():
    begin = [
        Vehicle(s=0.0, speed=30.0, driver=OVERTAKES),
        Vehicle(s=70.0, speed=18.0, driver=STAYS | {"desired_speed": 18.0}),
    ]
    # The deadline limits the time to the attempt, not the whole overtake.
    run = sumo.simulate(scenario(begin, road=wide_road(), horizon=40.0, attempt_deadline=8.0))
    stage = run.stage[0, : run.num_frames[0]]
    order = stage[np.flatnonzero(np.diff(stage, prepend=255))].tolist()
    assert order == [Stage.FOLLOW, Stage.PULL_OUT, Stage.PASS, Stage.RETURN, Stage.DONE]
    done_frame = int(np.flatnonzero(stage == Stage.DONE)[0])
    assert run.num_frames[0] - 1 - done_frame == 60  # 3 s.
    assert run.states.lane[0, 0, run.num_frames[0] - 1] == 0


def test_drivers_without_a_speed_gain_stay_in_their_lane():
    begin = [Vehicle(s=0.0, speed=20.0), Vehicle(s=50.0, speed=20.0)]
    still = [Vehicle(s=v.s, speed=20.0, driver=STAYS | {"desired_speed": 20.0}) for v in begin]
    run = sumo.simulate(scenario(still, horizon=20.0))
    assert (run.states.lane[0, :2] == 0).all()
    assert np.ptp(run.states.d[0, :2], axis=1).tolist() == [0, 0]


def test_without_an_attempt_the_simulation_ends_at_the_deadline():
    begin = [Vehicle(s=0.0, speed=20.0, driver=STAYS | {"desired_speed": 20.0})]
    run = sumo.simulate(scenario(begin, horizon=20.0, attempt_deadline=8.0))
    assert run.num_frames.tolist() == [161]


def test_a_contact_is_recorded_for_both_and_ends_the_simulation():
    begin = [
        Vehicle(s=0.0, speed=40.0, driver=STAYS | {"desired_speed": 40.0}),
        Vehicle(s=12.0, speed=0.0, driver=STAYS | {"desired_speed": 1.0}),
    ]
    run = sumo.simulate(scenario(begin, horizon=20.0))
    assert run.contacts.partner[0, :2].tolist() == [1, 0]
    assert run.contacts.partner[0, 2:].tolist() == [NO_VEHICLE] * 6
    first = int(run.contacts.time[0, 0])
    assert 100 <= first <= 300  # 7.5 m at 40 m/s.
    assert run.num_frames[0] == first // 50 + 1 + 40  # 2 s.
    assert run.stage[0, run.num_frames[0] - 1] == Stage.CRASHED
    assert run.collided_with[0, first // 50] == 1
    assert run.collided_with[0, first // 50 - 1] == NO_VEHICLE
    assert 20_000 < run.contacts.closing_speed[0, 0] <= 40_000


@pytest.mark.ci
def test_left_hand_traffic_is_the_mirror_image():
    road = known_road("town06")
    right_hand, left_hand = (
        sumo.simulate(sampled(3).replace(road=traffic_road))
        for traffic_road in (road, road.mirror())
    )
    assert (right_hand.num_frames == left_hand.num_frames).all()
    for name in ("s", "speed", "accel_lon", "lane"):
        assert (getattr(right_hand.states, name) == getattr(left_hand.states, name)).all(), name
    for name in ("d", "accel_lat"):
        assert (getattr(right_hand.states, name) == -getattr(left_hand.states, name)).all(), name


# --- determinism ---


@pytest.mark.ci
def test_the_same_scenarios_give_the_same_hashes(batch):
    again = sumo.simulate(batch.scenario)
    assert (again.trace_hash == batch.trace_hash).all()
    assert len({tuple(row) for row in batch.trace_hash}) == 12


def test_a_simulation_is_the_same_alone_and_in_a_batch(batch):
    for row in (0, 7, 11):
        alone = sumo.simulate(batch.scenario.select(slice(row, row + 1)))
        assert (alone.trace_hash[0] == batch.trace_hash[row]).all()


def test_the_simulation_number_decides_the_randomness_of_a_scene():
    world = scenario(*[[Vehicle(), Vehicle(s=40.0, speed=22.0)]] * 2, horizon=5.0)
    run = sumo.simulate(world)
    assert (run.states.s[0] != run.states.s[1]).any()
    twins = sumo.simulate(world.replace(scenario_index=np.array([4, 4], np.uint64)))
    assert (twins.trace_hash[0] == twins.trace_hash[1]).all()


@pytest.mark.parametrize(
    ("interval", "step"), [(10, 10), (40, 40), (50, 50), (70, 35), (100, 50), (130, 26), (1000, 50)]
)
def test_frames_are_whole_steps_of_at_most_50_ms(interval, step):
    assert sumo.step_ms(interval) == step


def test_frames_at_half_the_rate_are_every_second_frame():
    half = sumo.simulate(sampled(2).replace(frame_interval_ms=100)).states.s
    full = sumo.simulate(sampled(2)).states.s
    count = min(half.shape[2], (full.shape[2] + 1) // 2, 81)
    assert (half[:, :, :count] == full[:, :, ::2][:, :, :count]).all()


# --- one simulation per process ---


def test_a_simulation_that_the_caller_has_open_is_left_alone(tmp_path):
    net = tmp_path / "road.net.xml"
    net.write_text(network(wide_road(), 500.0, [1.0] * 3), encoding="utf-8")
    libsumo = library()
    libsumo.start(["sumo", "--net-file", str(net), "--no-step-log", "true"])
    try:
        with pytest.raises(ConfigError, match="one simulation at a time"):
            sumo.simulate(scenario([Vehicle()]))
        assert libsumo.isLoaded()
    finally:
        libsumo.close()
    assert sumo.simulate(scenario([Vehicle()], horizon=1.0)).num_frames.tolist() == [21]


def test_a_second_thread_cannot_use_sumo_at_the_same_time(tmp_path):
    errors = []

    def simulate_in_thread():
        try:
            sumo.simulate(scenario([Vehicle()]))
        except ConfigError as error:
            errors.append(str(error))

    with running_network(wide_road(), tmp_path):
        thread = threading.Thread(target=simulate_in_thread)
        thread.start()
        thread.join()
    assert len(errors) == 1
    assert "another thread" in errors[0]


def test_an_error_of_sumo_is_one_line_and_leaves_sumo_closed(tmp_path):
    with (
        pytest.raises(ConfigError, match="a scenario that SUMO can run"),
        running(["--net-file", str(tmp_path / "missing.net.xml")]),
    ):
        pass
    assert not library().isLoaded()


def test_without_libsumo_the_error_names_the_package_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "libsumo", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'libsumo>="):
        sumo.simulate(scenario([Vehicle()]))


@pytest.mark.ci
def test_loading_libsumo_prints_nothing_and_keeps_the_environment():
    script = (
        "import os; before = dict(os.environ);"
        "from overtaking.simulators.sumo.library import library; library();"
        "assert dict(os.environ) == before"
    )
    process = subprocess.run(
        [sys.executable, "-W", "error", "-c", script], capture_output=True, text=True, check=False
    )
    assert (process.returncode, process.stdout, process.stderr) == (0, "", "")


def test_sumo_drives_on_a_road_with_bends_and_hills_as_on_a_straight_road():
    straight = wide_road()
    winding = on(straight, *BENDS, grade=HILLS)
    scene = [Vehicle(s=50.0, lane=1, speed=25.0, driver=OVERTAKES), Vehicle(s=110.0, lane=1)]
    flat, bent = (
        sumo.simulate(scenario(scene, road=road, horizon=20.0)) for road in (straight, winding)
    )
    for name in ("s", "d", "speed", "lane"):
        np.testing.assert_array_equal(getattr(bent.states, name), getattr(flat.states, name))
    is_recorded = bent.state_mask
    s, d = (metres(getattr(bent.states, name)[is_recorded]) for name in "sd")
    x, y = winding.to_world(s, d)
    np.testing.assert_allclose(metres(bent.states.x[is_recorded]), x, atol=1e-3)
    np.testing.assert_allclose(metres(bent.states.y[is_recorded]), y, atol=1e-3)
    heading_to_road = bent.headings_and_origin[0][is_recorded] * 1e-4
    straight_heading = flat.states.heading[is_recorded] * 1e-4 - straight.heading
    np.testing.assert_allclose(heading_to_road, straight_heading, atol=2e-4)


# --- two directions ---


def two_way_batch(**changes):
    scenes = [pair(), pair(300.0), pair(500.0, 700.0)]
    road = two_way_road()
    if changes.get("mirrored"):
        road = road.mirror()
    return scenario(*scenes, road=road, horizon=35.0)


@pytest.mark.parametrize("mirrored", [False, True])
def test_oncoming_vehicles_start_at_the_same_state_as_on_the_engine(mirrored):
    world = two_way_batch(mirrored=mirrored)
    run, engine_run = sumo.simulate(world), engine.simulate(world)
    oncoming = np.argwhere(world.vehicles.valid & (world.start_lane == 1))
    assert len(oncoming) == 3
    for row, slot in oncoming:
        for name in ("x", "y", "s", "d", "speed", "heading", "lane"):
            sumo_value, engine_value = (
                int(getattr(simulated.states, name)[row, slot, 0])
                for simulated in (run, engine_run)
            )
            distance = (
                (sumo_value - engine_value + 31416) % 62832 - 31416
                if name == "heading"
                else sumo_value - engine_value
            )
            assert abs(distance) <= 1, name
        s = metres(run.states.s[row, slot, : run.num_frames[row]])
        assert (np.diff(s) < 0).all()
        speed = metres(run.states.speed[row, slot, : run.num_frames[row]])
        np.testing.assert_allclose(-np.diff(s) / 0.05, speed[1:], atol=0.35)


def test_the_ego_in_sumo_overtakes_in_the_opposing_lane_between_oncoming_vehicles():
    world = two_way_batch()
    run = sumo.simulate(world)
    side = metres(run.states.d[:, 0])
    for row in range(world.num_simulations):
        frames = int(run.num_frames[row])
        out = np.flatnonzero(side[row, :frames] > 0.0)
        assert len(out)  # The line between the directions is at d = 0.
        assert side[row, frames - 1] == pytest.approx(float(world.road.lane_centres[0]), abs=0.3)
        target = metres(run.states.s[row, 1])
        assert metres(run.states.s[row, 0])[frames - 1] > target[frames - 1]
        for slot in np.flatnonzero(world.start_lane[row] == 1):
            met = np.flatnonzero(run.states.s[row, slot, :frames] < run.states.s[row, 0, :frames])
            assert len(met)
            assert not (out[0] < met[0] < out[-1])
    assert (run.contacts.partner == NO_VEHICLE).all()


# --- limits that change along the road ---


def test_drivers_slow_down_to_a_lower_limit_and_speed_up_behind_it(without_errors):
    obeys = STAYS | {"desired_speed": 28.0, "speed_limit_compliance": 1.0}
    road = limited(wide_road(), SpeedLimitSpan(start=600.0, stop=900.0, speed=15.0))
    world = scenario([Vehicle(s=100.0, lane=1, speed=25.0, driver=obeys)], road=road, horizon=60.0)
    run = sumo.simulate(world)
    s, speed = (
        metres(getattr(run.states, name)[0, 0, : run.num_frames[0]]) for name in ("s", "speed")
    )
    assert speed[s < 400.0].min() > 24.5
    assert speed[(s > 600.0) & (s < 900.0)].max() < 15.5
    assert speed[s > 1150.0].min() > 20.0


def test_oncoming_drivers_obey_the_limits_of_their_own_direction(without_errors):
    obeys = STAYS | {"desired_speed": 28.0, "speed_limit_compliance": 1.0}
    lower = SpeedLimitSpan(start=600.0, stop=900.0, speed=15.0, direction=-1)
    road = limited(known_road("rural"), lower)
    pair = [
        Vehicle(s=100.0, speed=25.0, driver=obeys),
        Vehicle(s=1400.0, lane=1, speed=25.0, driver=obeys),
    ]
    run = sumo.simulate(scenario(pair, road=road, horizon=50.0))
    s, speed = (
        metres(getattr(run.states, name)[0, :, : run.num_frames[0]]) for name in ("s", "speed")
    )
    assert speed[0].min() > 24.5
    inside = (s[1] > 600.0) & (s[1] < 900.0)
    assert inside.any()
    assert speed[1][inside].max() < 15.5
