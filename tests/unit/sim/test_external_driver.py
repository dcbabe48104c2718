"""External drivers: their answers are checked, rounded, recorded and carried out."""

from __future__ import annotations

import math

import numpy as np
import pytest

import overtaking as ot
from overtaking.core.errors import ConfigError, DriverError
from overtaking.model.driver_interface import NEIGHBOUR_COLUMNS, NEIGHBOUR_ROLES, NeighbourColumns
from overtaking.model.trajectories import NO_VEHICLE, Lights, Stage
from overtaking.sim.action_spaces import ACTION_SPACES
from overtaking.sim.sensors import Sensor, SensorArray
from overtaking.world.step_parameters import step_parameters

pytestmark = pytest.mark.ci

SHORT = {"time.horizon_s": 6.0, "time.attempt_deadline_s": 6.0}

RADAR = Sensor(
    range_ahead=150.0,
    range_behind=80.0,
    range_around=20.0,
    field_of_view=math.radians(60.0),
    latency=0.1,
    gap_error=0.2,
    closing_speed_error=0.1,
    missed=0.02,
    rain_loss=0.2,
    fog_loss=0.1,
)


@pytest.fixture(scope="module")
def scenes() -> ot.Scenario:
    return ot.sample("pinto2023-physical", num_simulations=6, seed=2, overrides=SHORT)


@pytest.fixture(scope="module")
def calm(scenes: ot.Scenario) -> ot.Scenario:
    """The same scenarios without wind, against which an external driver would have to steer."""
    return scenes.replace(weather=scenes.weather.replace(wind=np.zeros(6, np.float32)))


def constant(*answer: float):
    return lambda observation: np.tile(answer, (len(observation.is_running), 1))


def speeds(run: ot.Trajectories) -> np.ndarray:
    """Speed of the egos, (simulation, time) [m/s]."""
    return run.states.speed[:, 0] * 1e-3


def test_an_acceleration_is_carried_out_with_the_egos_jerk(scenes):
    run = ot.drive(scenes, constant(-1.0, 0.0), observation="truth")
    accel = run.states.accel_lon[:, 0, 60:-1] * 1e-3
    sound = (run.collided_with == NO_VEHICLE) & run.frame_mask
    rolls = (speeds(run) > 2.0)[:, 60:-1] & sound[:, 60:-1]
    assert rolls.any(axis=1).sum() >= 5
    np.testing.assert_allclose(accel[rolls], -1.0, atol=0.05)


def test_a_speed_is_reached(calm):
    run = ot.drive(calm, constant(20.0, 0.0), observation="human", action="speed_lane")
    sound = run.contacts.time[:, 0] == 0
    assert sound.sum() >= 4
    end = speeds(run)[np.arange(6), run.num_frames - 1]
    np.testing.assert_allclose(end[sound], 20.0, atol=2.0)


def test_a_requested_lane_change_is_indicated_first_and_ends_in_the_middle_of_the_lane(scenes):
    run = ot.drive(scenes, constant(0.0, 1.0), observation="human")
    states = run.states
    for row in range(6):
        moved = np.flatnonzero(states.lane[row, 0] > states.lane[row, 0, 0])
        if states.lane[row, 0, 0] == run.road.num_lanes - 1:
            continue
        assert moved.size
        uses = scenes.drivers.uses_indicator[row, 0] > 0
        indicated = np.flatnonzero(states.lights[row, 0] & 3)
        assert (indicated[:1] < moved[0] - 20).all() == uses or not uses


def test_a_trajectory_is_followed(calm):
    start = dict[str, np.ndarray]()

    def wave(observation: ot.Observation) -> np.ndarray:
        """Points at constant speed, half a metre to the overtaking side of the start position."""
        times, ahead = np.array([0.5, 1.0, 1.5, 2.0]), observation.ego.speed
        start_position = start.setdefault("lateral", observation.ego.lateral_position.copy())
        aside = np.where(
            observation.is_running, start_position + 0.5 - observation.ego.lateral_position, 0.0
        )
        points = [(ahead * t, aside) for t in times]
        return np.stack([number for pair in points for number in pair], axis=1)

    run = ot.drive(calm, wave, observation="truth", action="trajectory", action_repeat=4)
    last = run.num_frames - 1
    d = run.states.d[np.arange(6), 0] * 1e-3
    distance = np.abs(d[np.arange(6), last] - d[:, 0])
    sound = run.contacts.time[:, 0] == 0
    assert sound.sum() >= 4
    np.testing.assert_allclose(distance[sound], 0.5, atol=0.05)
    change = speeds(run)[np.arange(6), last] - speeds(run)[:, 0]
    assert (np.abs(change[sound]) < 0.5).all()
    assert run.actions
    assert run.actions.kind == "accel_steer"


@pytest.fixture(scope="module")
def without_indicators(scenes: ot.Scenario) -> ot.Scenario:
    """The same scenarios with drivers that use no indicator."""
    drivers = scenes.drivers
    return scenes.replace(
        drivers=drivers.replace(uses_indicator=np.zeros_like(drivers.uses_indicator))
    )


def indicated_side(run: ot.Trajectories) -> np.ndarray:
    """Side that each ego indicates, (simulation, time): 1 overtaking side, -1 kerb side, 0 none."""
    lights = run.states.lights[:, 0]
    left, right = ((lights & lamp) != 0 for lamp in (Lights.INDICATOR_LEFT, Lights.INDICATOR_RIGHT))
    return run.road.overtaking_sign * (left.astype(int) - right)


def test_a_move_with_an_acceleration_is_indicated_before_it_begins(without_indicators):
    def pull_out(observation: ot.Observation) -> np.ndarray:
        """Indicate from 1 s on, pull out after 3 s."""
        move = [ot.Move.KEEP, ot.Move.INDICATE_PULL_OUT, ot.Move.PULL_OUT][
            (observation.time >= 1.0) + int(observation.time >= 3.0)
        ]
        return np.tile([0.2, move], (len(observation.is_running), 1))

    run = ot.drive(without_indicators, pull_out, observation="human", action="accel_move")
    free = run.states.lane[:, 0, 0] < run.road.num_lanes - 1
    free &= (run.collided_with == NO_VEHICLE).all(axis=1)
    assert free.sum() >= 3
    assert not indicated_side(run)[free, :20].any()
    assert (indicated_side(run)[free, 20:80] == 1).all()
    assert (run.stage[free, :60] == Stage.FOLLOW).all()
    assert (run.stage[free, 60] == Stage.PULL_OUT).all()
    # With the action space `decision` the model driver indicates, which uses no indicator here.
    by_decisions = ot.drive(
        without_indicators,
        lambda observation: pull_out(observation)[:, 1],
        observation="human",
        action="decision",
    )
    assert not indicated_side(by_decisions)[free].any()
    rolls = run.states.accel_lon[free, 0, 40:60] * 1e-3
    np.testing.assert_allclose(rolls, 0.2, atol=0.05)


def test_a_steering_driver_sets_the_indicator_itself(without_indicators):
    sides = np.array([1, 0, -1])

    def alternate_sides(observation: ot.Observation) -> np.ndarray:
        side = sides[observation.decision_index // 30 % 3]
        return np.tile([0.0, 0.0, side], (len(observation.is_running), 1))

    run = ot.drive(
        without_indicators, alternate_sides, observation="truth", action="accel_steer_signal"
    )
    sound = (run.stage != Stage.CRASHED) & run.frame_mask
    expected_sides = np.broadcast_to(sides[np.arange(sound.shape[1]) // 30 % 3], sound.shape)
    assert sound.sum() > 300
    np.testing.assert_array_equal(indicated_side(run)[sound], expected_sides[sound])
    plain = ot.drive(
        without_indicators, constant(0.0, 0.0), observation="truth", action="accel_steer"
    )
    assert not indicated_side(plain)[:, :60].any()
    assert run.actions
    assert run.actions.kind == "accel_steer_signal"


def test_answers_beyond_the_limits_are_counted(scenes):
    def often(observation: ot.Observation) -> np.ndarray:
        """Every second answer of ego 0 and all of ego 2 exceed a limit; ego 1 stays at limits."""
        answer = np.zeros((6, 2))
        answer[0, 0] = 25.0 if observation.decision_index % 8 == 0 else 0.0
        answer[1] = (np.nextafter(20.0, 21.0), 1.0)
        answer[2, 1] = -3.0
        return answer

    run = ot.drive(scenes, often, observation="human", action_repeat=4)
    assert run.actions
    clipped = run.actions.num_clipped
    assert clipped is not None
    decision_indices = -(-(run.num_frames - 1) // 4)
    assert abs(int(clipped[0]) - decision_indices[0] / 2) <= 1
    assert abs(int(clipped[2]) - decision_indices[2]) <= 1
    assert not clipped[[1, 3, 4, 5]].any()


def test_recorded_actions_repeat_the_simulation(scenes):
    finer = ot.drive(scenes, constant(0.123_4, 0.0), observation="human")
    rounded = ot.drive(scenes, constant(0.123, 0.0), observation="human")
    np.testing.assert_array_equal(finer.trace_hash, rounded.trace_hash)
    assert finer.actions
    assert rounded.actions
    np.testing.assert_array_equal(finer.actions.values, rounded.actions.values)
    assert finer.actions.hashes == rounded.actions.hashes
    different = ot.drive(scenes, constant(0.124, 0.0), observation="human")
    assert different.actions
    assert set(different.actions.hashes).isdisjoint(finer.actions.hashes)
    far = ot.drive(scenes, constant(1e9, 0.0), observation="human")
    assert far.actions
    assert far.actions.values.max() == 20_000


def test_an_answer_holds_for_action_repeat_decisions(scenes):
    decision_indices = list[int]()

    def driver(observation: ot.Observation) -> np.ndarray:
        decision_indices.append(observation.decision_index)
        return np.tile([0.01 * len(decision_indices), 0.0], (6, 1))

    run = ot.drive(scenes, driver, observation="human", action_repeat=7)
    assert decision_indices == list(range(0, 121, 7))[: len(decision_indices)]
    assert run.actions
    first = run.actions.values[:, :14, 0]
    np.testing.assert_array_equal(first, np.repeat([10, 20], 7) + np.zeros((6, 14)))


def test_a_driver_draws_the_same_numbers_in_every_batch(scenes):
    def draws(observation: ot.Observation) -> np.ndarray:
        return np.stack(
            [
                4.0 * observation.uniform_numbers()[:, 0] - 3.0,
                np.zeros(len(observation.is_running)),
            ],
            axis=1,
        )

    all_rows = ot.drive(scenes, draws, observation="human")
    part = ot.drive(scenes.select(slice(2, 4)), draws, observation="human")
    np.testing.assert_array_equal(part.trace_hash, all_rows.trace_hash[2:4])


def fails(observation: ot.Observation) -> np.ndarray:
    raise ZeroDivisionError("of mine")


def names_wrongly(observation: ot.Observation) -> np.ndarray:
    return observation.ego.speeds  # pyright: ignore[reportAttributeAccessIssue]


def sometimes_nan(observation: ot.Observation) -> np.ndarray:
    answer = np.zeros((len(observation.is_running), 2))
    answer[3, 0] = np.nan if observation.decision_index == 20 else 0.0
    return answer


def changes_its_mind(observation: ot.Observation) -> np.ndarray:
    return np.zeros((len(observation.is_running), 2 if observation.decision_index < 9 else 3))


@pytest.mark.parametrize(
    ("driver", "message"),
    [
        (fails, "simulation 0 and 5 others at 0.00 s.*an answer, got ZeroDivisionError in .*: of"),
        (fails, f"in test_external_driver.py, line {fails.__code__.co_firstlineno + 1}: of mine"),
        (names_wrongly, "AttributeError in .*no attribute 'speeds'; similar names: speed"),
        (lambda observation: observation.leader.speed, "'speed'; similar names: .*closing_speed"),
        (lambda observation: observation.left_lead.gap, "'left_lead'; similar names: left_leader"),
        (lambda _: [[1.0], [1.0, 2.0]], "an answer, got ValueError"),
        (sometimes_nan, r"simulation 3 at 1.00 s.*finite numbers, got \[nan, 0.0\]"),
        (changes_its_mind, r"at 0.45 s.*shape \(6, 2\): accel, lane_change, got shape \(6, 3\)"),
        (lambda _: np.zeros(6), r"at 0.00 s.*got shape \(6,\)"),
        (lambda _: ["left"] * 6, "numbers, got an array of <U4"),
        (lambda _: None, "numbers, got an array of object"),
    ],
)
def test_an_invalid_answer_raises_one_clear_error(scenes, driver, message):
    with pytest.raises(DriverError, match=message) as raised:
        ot.drive(scenes, driver, observation="human")
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    "wrong",
    [{"observation": "everything"}, {"action": "fly"}, {"action_repeat": 0}, {"simulator": "sumo"}],
)
def test_an_invalid_argument_is_rejected(scenes, wrong):
    with pytest.raises(ConfigError):
        ot.drive(scenes, constant(0.0, 0.0), **({"observation": "human"} | wrong))


def test_the_observation_has_no_default(scenes):
    with pytest.raises(ConfigError, match="observation: expected human, truth or a Sensor"):
        ot.drive(scenes, constant(0.0, 0.0))


def test_a_driver_states_its_observation_and_action_itself(scenes):
    function = constant(10.0)
    driver = ot.Driver(function=function, observation="truth", action="decision", action_repeat=4)
    expected = ot.drive(scenes, function, observation="truth", action="decision", action_repeat=4)
    assert (ot.drive(scenes, driver).trace_hash == expected.trace_hash).all()
    with pytest.raises(ConfigError, match="action_repeat: expected no value beside a Driver"):
        ot.drive(scenes, driver, action_repeat=4)


def test_every_action_names_its_numbers():
    assert {name: len(space.parts) for name, space in ACTION_SPACES.items()} == {
        "accel_lane": 2,
        "speed_lane": 2,
        "accel_steer": 2,
        "trajectory": 8,
        "decision": 1,
        "accel_move": 2,
        "accel_steer_signal": 3,
    }


class TestSensor:
    def measure(self, scenes, decisions=40, **changes):
        """True columns at some decisions, and the columns that a sensor measures."""
        params = step_parameters(scenes)
        sensor = Sensor(**{name: getattr(RADAR, name) for name in RADAR.__slots__} | changes)
        sensors = SensorArray(sensor, scenes, params)
        truth = np.zeros((decisions, 6, len(NEIGHBOUR_ROLES), len(NEIGHBOUR_COLUMNS)), np.float32)
        columns = NeighbourColumns._make(np.moveaxis(truth, -1, 0))
        columns.is_detected[...] = 1.0
        columns.gap[...] = np.linspace(5.0, 200.0, decisions)[:, None, None]
        columns.closing_speed[...] = 5.0
        is_running = np.ones(6, bool)
        measured = np.stack(
            [sensors.measure(true_values, is_running, k) for k, true_values in enumerate(truth)]
        )
        return columns, NeighbourColumns._make(np.moveaxis(measured, -1, 0))

    def test_ranges_are_the_stated_ones(self, scenes):
        clear = scenes.replace(
            weather=scenes.weather.replace(
                rain=np.zeros(6, np.float32), fog=np.zeros(6, np.float32)
            )
        )
        truth, measured = self.measure(clear, latency=0.0, missed=0.0, gap_error=0.0)
        ahead = np.array([name.endswith(("leader", "oncoming")) for name in NEIGHBOUR_ROLES])
        half = step_parameters(clear).vehicles.at_slots(0).half_length[:, None]
        within = truth.gap + half <= np.where(ahead, 150.0, 80.0)
        np.testing.assert_array_equal(measured.is_detected > 0, within)
        np.testing.assert_array_equal(measured.gap[within], truth.gap[within])

    def test_rain_shortens_the_ranges(self, scenes):
        heavy = scenes.weather.replace(rain=np.full(6, 100.0, np.float32))
        _, measured = self.measure(scenes.replace(weather=heavy), missed=0.0, gap_error=0.0)
        assert measured.gap[measured.is_detected > 0].max() <= 0.8 * 150.0

    def test_measurements_are_as_old_as_the_latency(self, scenes):
        _, now = self.measure(scenes, latency=0.0)
        _, late = self.measure(scenes, latency=0.15)
        np.testing.assert_array_equal(late.gap[3:], now.gap[:-3])

    def test_errors_and_misses_have_the_stated_frequency(self, scenes):
        no_losses = {"range_ahead": 500.0, "range_behind": 500.0, "rain_loss": 0.0, "fog_loss": 0.0}
        truth, measured = self.measure(
            scenes, 400, latency=0.0, missed=0.1, gap_error=0.5, **no_losses
        )
        detected_shares = measured.is_detected > 0
        assert abs(detected_shares.mean() - 0.9) < 0.01  # 19,200 draws: a standard error of 0.002
        error = (measured.gap - truth.gap)[detected_shares]
        assert abs(error.mean()) < 0.02
        assert abs(error.std() - 0.5) < 0.02

    def test_a_file_describes_a_sensor(self, tmp_path, repository):
        assert Sensor.from_file(repository / "examples" / "radar.toml").range_ahead > 0.0
        wrong = tmp_path / "sensor.toml"
        wrong.write_text("range_ahead = 100.0\n", encoding="utf-8")
        with pytest.raises(ConfigError, match="latency"):
            Sensor.from_file(wrong)

    def test_impossible_numbers_are_rejected(self):
        with pytest.raises(ConfigError, match="missed"):
            Sensor(**{name: getattr(RADAR, name) for name in RADAR.__slots__} | {"missed": 1.5})

    def test_a_driver_may_observe_through_a_sensor(self, scenes):
        detected_shares = list[float]()

        def driver(observation: ot.Observation) -> np.ndarray:
            detected_shares.append(float((observation.leader.is_detected > 0).mean()))
            return np.zeros((6, 2))

        ot.drive(scenes, driver, observation=RADAR)
        assert 0.0 < np.mean(detected_shares) < 1.0
