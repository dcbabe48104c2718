"""Environments keep the promises of Gymnasium and are the simulations of `overtaking.drive`."""

from __future__ import annotations

import copy
import itertools
import pickle
import subprocess
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import RecordVideo
from tests.support.integers import INTEGER_TYPES, NO_INTEGERS

import overtaking as ot
import overtaking.gym as envs
from overtaking.core.errors import ConfigError
from overtaking.gym.spaces import clip_observation
from overtaking.knowledge import toml_reader
from overtaking.model.driver_interface import OBSERVATION_SIZE
from overtaking.model.overtake_events import Outcome
from overtaking.model.trajectories import Stage
from overtaking.show.video.film import Film
from overtaking.sim.action_spaces import ACTION_SPACES

SHORT = {"time.horizon_s": 8.0, "time.attempt_deadline_s": 6.0}
PROFILE = "pinto2023-physical"
QUICK = {"action_repeat": 4, "overrides": SHORT}


def made(count: int = 6, **settings) -> envs.OvertakingVectorEnv:
    return envs.OvertakingVectorEnv(PROFILE, count, **(QUICK | settings))


def wish(numbers: np.ndarray) -> np.ndarray:
    """A policy of what is observed: change to the fast side while somebody is near ahead."""
    table = dict(zip([one.name for one in envs.OBSERVATION_COLUMNS], numbers.T, strict=True))
    near = table["leader.gap"] < 60.0
    return np.stack([np.where(near, 0.0, 0.5), np.where(near, 1.0, -1.0)], axis=1)


def episodes(env: envs.OvertakingVectorEnv, steps: int, seed: int = 5) -> list[dict]:
    """The endings of some steps, with the number of the simulation."""
    seen, _ = env.reset(seed=seed)
    endings = []
    for _ in range(steps):
        seen, _, terminated, truncated, info = env.step(wish(seen))
        for row in np.flatnonzero(terminated | truncated):
            names = [name for name in info if not name.startswith("_") and info[f"_{name}"][row]]
            endings.append({name: info[name][row].item() for name in names} | {"row": int(row)})
    return endings


@pytest.mark.filterwarnings("ignore:.*symmetric and normalized")  # Our actions have units.
@pytest.mark.parametrize("action", ACTION_SPACES)
def test_gymnasium_accepts_it(action):
    env = gymnasium.make(
        f"overtaking/{PROFILE}-v0",
        observation="truth",
        action=action,
        action_repeat=10,
        overrides=SHORT,
        render_mode="rgb_array",
    )
    check_env(env.unwrapped, skip_close_check=True)


def test_every_profile_is_an_environment():
    for name in ("motorway", "motorway-risk", "pinto2023", "pinto2023-physical"):
        assert gymnasium.spec(f"overtaking/{name}-v0")


def test_make_vec_gives_the_native_one():
    env = gymnasium.make_vec(f"overtaking/{PROFILE}-v0", num_envs=3, **QUICK)
    assert isinstance(env.unwrapped, envs.OvertakingVectorEnv)
    seen, _ = env.reset(seed=1)
    assert seen.shape == (3, OBSERVATION_SIZE)
    assert env.observation_space.contains(seen)


def test_an_episode_is_the_simulation_of_drive():
    """Bit for bit, with verdicts, though others began and ended around it at other times."""
    ended = episodes(made(with_labels=True), 120)
    assert len({one["scenario_index"] for one in ended}) == len(ended) >= 8
    assert all(one["scenario_index"] % 6 == one["row"] for one in ended)
    most = max(one["scenario_index"] for one in ended)
    scenes = ot.sample(PROFILE, num_simulations=most + 1, seed=5, overrides=SHORT)
    run = ot.drive(
        scenes,
        lambda seen: wish(envs.flatten_observation(seen)),
        observation="human",
        action_repeat=4,
    )
    labels = ot.label(run).labels
    place = labels.policies.index("default")
    for one in ended:
        number = one["scenario_index"]
        assert one["outcome"] == labels.outcome[number]
        assert one["is_legal"] == labels.is_legal[number, place]
        assert one["num_broken"] == labels.num_broken[number, place]
    assert {Outcome.NO_ATTEMPT} < {Outcome(one["outcome"]) for one in ended}


def test_what_is_seen_is_what_drive_shows():
    """Observations of later episodes, which begin beside others that are under way."""
    env = made(4)
    shown = dict[int, list[np.ndarray]]()
    seen, info = env.reset(seed=5)
    index = info["scenario_index"].copy()
    waiting = np.zeros(4, bool)
    for _ in range(160):
        for row in range(4):
            shown.setdefault(int(index[row]), []).append(seen[row])
        seen, _, terminated, truncated, info = env.step(wish(seen))
        if waiting.any():
            index = info["scenario_index"].copy()
        waiting = terminated | truncated
    late = [number for number, rows in shown.items() if number >= 8 and len(rows) > 10]
    assert late
    scenes = ot.sample(PROFILE, num_simulations=max(late) + 1, seed=5, overrides=SHORT)
    told = list[np.ndarray]()

    def policy(observation: ot.Observation) -> np.ndarray:
        numbers = envs.flatten_observation(observation)
        told.append(np.where(observation.is_running[:, None], numbers, np.nan))
        return wish(numbers)

    ot.drive(scenes, policy, observation="human", action_repeat=4)
    for number in late:
        for k, numbers in enumerate(shown[number][:-1]):
            if k < len(told) and np.isfinite(told[k][number]).all():
                np.testing.assert_array_equal(numbers, told[k][number])


def test_the_same_seed_gives_the_same_episodes():
    assert episodes(made(), 40) == episodes(made(), 40)
    assert episodes(made(), 40) != episodes(made(), 40, seed=6)
    apart = {one["scenario_index"] for one in episodes(made(first_scenario=1000), 40)}
    assert min(apart) >= 1000


def test_actions_beyond_the_limits_are_counted_by_episode():
    env = made(3, action="speed_lane", action_repeat=10)
    env.reset(seed=5)
    steps, counted = np.zeros(3, int), list[tuple[int, int]]()
    ended = np.zeros(3, bool)
    for _ in range(40):
        *_, terminated, truncated, info = env.step(
            np.array([[30.0, 0.0], [200.0, 0.0], [30.0, 2.0]])
        )
        steps = np.where(ended, 0, steps + 1)
        ended = terminated | truncated
        for row in np.flatnonzero(ended):
            expected = 0 if row == 0 else int(steps[row])
            counted.append((int(info["num_clipped"][row]), expected))
    assert len(counted) > 3
    assert all(told == expected for told, expected in counted)
    assert max(told for told, _ in counted) > 5


def test_how_long_others_take_changes_nothing():
    """Episode k of environment i is number i + k n, whenever it begins."""
    ended = episodes(made(3), 120)
    for row in range(3):
        mine = [one["scenario_index"] for one in ended if one["row"] == row]
        assert mine == [row + 3 * k for k in range(len(mine))]
        assert len(mine) >= 2


def stepped(mode: AutoresetMode, steps: int = 60):
    """What each step gave."""
    env = made(5, autoreset_mode=mode)
    seen, _ = env.reset(seed=5)
    for _ in range(steps):
        before = seen
        seen, reward, terminated, truncated, info = env.step(wish(seen))
        yield env, before, seen, reward, terminated | truncated, info
        if mode == AutoresetMode.DISABLED and (terminated | truncated).any():
            mask = terminated | truncated
            kept = seen.copy()
            seen, _ = env.reset(options={"reset_mask": mask})
            np.testing.assert_array_equal(seen[~mask], kept[~mask])


def test_next_step_ignores_an_action_and_begins():
    waited = np.zeros(5, bool)
    begun = 0
    for _, _, seen, reward, ended, _ in stepped(AutoresetMode.NEXT_STEP):
        assert not (ended & waited).any()
        assert (reward[waited] == 0).all()
        stage = seen[:, [one.name for one in envs.OBSERVATION_COLUMNS].index("ego.stage")]
        assert (stage[waited] == Stage.FOLLOW).all()
        begun += int(waited.sum())
        waited = ended
    assert begun >= 5


def test_same_step_begins_at_once_and_keeps_the_last_observation():
    later = [
        (step[2], step[4], step[5]) for step in stepped(AutoresetMode.SAME_STEP) if step[4].any()
    ]
    plain = [(step[2], step[4]) for step in stepped(AutoresetMode.NEXT_STEP) if step[4].any()]
    seen, ended, info = later[0]
    np.testing.assert_array_equal(info["_final_obs"], ended)
    first, mask = plain[0]
    np.testing.assert_array_equal(mask, ended)
    for row in np.flatnonzero(ended):
        np.testing.assert_array_equal(info["final_obs"][row], first[row])
        assert not np.array_equal(seen[row], first[row])
    assert info["final_info"]["_scenario_index"][ended].all()


def test_disabled_wants_a_reset_of_those_that_have_ended():
    for env, _, _, _, ended, _ in stepped(AutoresetMode.DISABLED):
        if ended.any():
            with pytest.raises(ConfigError, match="reset_mask"):
                env.step(np.zeros((5, 2)))
            return
    pytest.fail("no episode has ended")


def test_an_end_is_an_accident_an_overtake_or_the_clock():
    env = made(32, action="accel_steer", overrides=SHORT)
    env.reset(seed=1)
    crashes = 0
    for _ in range(40):
        drift = np.tile([0.0, 0.02], (32, 1))
        seen, _, terminated, truncated, _ = env.step(drift)
        stage = seen[:, [one.name for one in envs.OBSERVATION_COLUMNS].index("ego.stage")]
        crashes += int((terminated & (stage == Stage.CRASHED)).sum())
        assert not (terminated & truncated).any()
    assert crashes >= 32


@pytest.mark.parametrize(
    "wrong",
    [
        {"observation": "radar"},
        {"action": "fly"},
        {"action_repeat": 0},
        {"reward": "money"},
        {"first_scenario": -1},
        {"count": 0},
        {"render_mode": "human"},
        {"autoreset_mode": "LATER"},
        {"reward": "overtake_once"},  # Without labels.
    ],
)
def test_an_argument_that_cannot_be_used_is_refused(wrong):
    with pytest.raises(ConfigError):
        made(**wrong)


@pytest.mark.parametrize("actions", [np.zeros((6, 3)), np.full((6, 2), np.nan), np.zeros(5)])
def test_actions_that_are_none_are_refused(actions):
    env = made()
    env.reset(seed=1)
    with pytest.raises(ValueError, match=r"shape \(6, 2\)"):
        env.step(actions)


def test_it_says_that_reset_comes_first():
    with pytest.raises(ConfigError, match="reset"):
        made().step(np.zeros((6, 2)))


def test_normalized_numbers_are_divided_by_their_scales():
    plain, normalized = made().reset(seed=1)[0], made(normalize=True).reset(seed=1)[0]
    scale = np.array([one.scale for one in envs.OBSERVATION_COLUMNS], np.float32)
    np.testing.assert_array_equal(normalized, plain / scale)
    assert made(normalize=True).observation_space.contains(normalized)


def test_observations_are_nobody_elses():
    env = made()
    first, _ = env.reset(seed=1)
    kept = first.copy()
    env.step(wish(first))
    np.testing.assert_array_equal(first, kept)


def test_the_observation_of_a_pass_is_not_clipped():
    """The gap factor of a truck is 2.2: bounds of 0 and 1 would hide it."""
    table = np.zeros((1, OBSERVATION_SIZE), np.float32)
    [index] = (
        index
        for index, column in enumerate(envs.OBSERVATION_COLUMNS)
        if column.name == "passing.tall_vehicle_gap_factor"
    )
    table[:, index] = toml_reader.number("model.oncoming.tall_vehicle_gap_factor")
    assert (clip_observation(table, normalize=False) == table).all()


def test_every_column_has_name_unit_and_bounds():
    assert len(envs.OBSERVATION_COLUMNS) == OBSERVATION_SIZE
    assert len({one.name for one in envs.OBSERVATION_COLUMNS}) == OBSERVATION_SIZE
    for one in envs.OBSERVATION_COLUMNS:
        assert one.unit
        assert one.low < one.high
        assert one.scale > 0.0


@pytest.mark.ci
def test_an_id_with_its_module_imports_by_itself():
    program = "import gymnasium; gymnasium.make_vec('overtaking.gym:overtaking/motorway-v0', 2)"
    subprocess.run([sys.executable, "-c", program], check=True)


@pytest.mark.parametrize("mode", AutoresetMode)
def test_an_autoreset_mode_is_named_as_in_gymnasium(mode):
    for spelling in (mode, mode.name, mode.value):
        assert made(autoreset_mode=spelling).autoreset_mode == mode


@pytest.mark.parametrize("mode", AutoresetMode)
def test_the_autoreset_mode_is_an_attribute_and_in_the_metadata(mode):
    arguments = {"num_envs": 2, "autoreset_mode": mode, **QUICK}
    env: Any = gymnasium.make_vec(f"overtaking.gym:overtaking/{PROFILE}-v0", **arguments)
    assert env.autoreset_mode == env.metadata["autoreset_mode"] == mode


@pytest.mark.parametrize("kind", INTEGER_TYPES)
def test_seeds_and_numbers_are_integers_of_any_library(kind):
    convert = INTEGER_TYPES[kind]
    settings = {"action_repeat": convert(4), "first_scenario": convert(3), "overrides": SHORT}
    env = envs.OvertakingVectorEnv(PROFILE, convert(3), **settings)
    expected = envs.OvertakingVectorEnv(
        PROFILE, 3, action_repeat=4, first_scenario=3, overrides=SHORT
    )
    options = {"scenario_index": [convert(9), convert(8), convert(7)]}
    observations, info = env.reset(seed=convert(7), options=options)
    np.testing.assert_array_equal(observations, expected.reset(seed=7, options=options)[0])
    assert info["scenario_index"].tolist() == [9, 8, 7]
    single = envs.OvertakingEnv(PROFILE, **settings)
    observation, info = single.reset(seed=convert(7), options={"scenario_index": convert(9)})
    np.testing.assert_array_equal(observation, observations[0])
    assert info["scenario_index"] == 9


@pytest.mark.parametrize("value", [*NO_INTEGERS, -1, 2**64])
def test_another_value_is_no_seed(value):
    for env in (made(2), envs.OvertakingEnv(PROFILE, **QUICK)):
        with pytest.raises(ConfigError, match=r"^reset: seed: expected 0 to 18446744073709551615"):
            env.reset(seed=value)


@pytest.mark.parametrize("value", [True, 7.0, "7", np.array([7, 7])])
def test_another_value_is_no_number_of_environments_or_simulation(value):
    with pytest.raises(ConfigError, match="num_envs"):
        made(value)
    with pytest.raises(ConfigError, match="first"):
        made(2, first_scenario=value)
    with pytest.raises(ConfigError, match="scenario_index"):
        made(1).reset(seed=1, options={"scenario_index": value})


def test_an_option_of_reset_chooses_the_simulations():
    env = made(3)
    _, info = env.reset(seed=5, options={"scenario_index": [7, 100, 2]})
    np.testing.assert_array_equal(info["scenario_index"], [7, 100, 2])
    observations, _ = env.reset(options={"scenario_index": [1, 0, 2]})
    _, info = env.reset()
    np.testing.assert_array_equal(
        info["scenario_index"], [0, 1, 2]
    )  # `index` does not advance the sequence.
    first, _ = env.reset(seed=5)
    np.testing.assert_array_equal(observations, first[[1, 0, 2]])
    mask = np.array([False, True, False])
    _, info = env.reset(options={"reset_mask": mask, "scenario_index": 40})
    np.testing.assert_array_equal(info["scenario_index"], [0, 40, 2])


@pytest.mark.parametrize(
    "options",
    [
        {"no_such_option": 1},
        {"scenario_index": -1},
        {"scenario_index": 1.5},
        {"scenario_index": [1, 2]},
        {"scenario_index": "seven"},
        {"reset_mask": [True, False]},
    ],
)
def test_options_of_reset_that_cannot_be_used_are_refused_by_name(options):
    with pytest.raises(ConfigError, match=next(iter(options))):
        made().reset(seed=1, options=options)
    if "reset_mask" not in options:
        with pytest.raises(ConfigError, match=next(iter(options))):
            single_env().reset(seed=1, options=options)


def single_env(**settings) -> envs.OvertakingEnv:
    return envs.OvertakingEnv(PROFILE, **(QUICK | settings))


def test_every_reset_names_the_simulation():
    env = single_env()
    assert env.reset(seed=5)[1]["scenario_index"] == 0
    assert env.reset()[1]["scenario_index"] == 1
    assert env.reset(options={"scenario_index": 70})[1]["scenario_index"] == 70
    for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP):
        indices = set()
        for *_, info in stepped(mode):
            indices |= set(info["scenario_index"].tolist())
        assert {0, 1, 2, 3, 4} < indices


FINAL = {"final_obs", "_final_obs", "final_info", "_final_info"}
"""Keys that Gymnasium defines for steps in which an episode ends and the next one begins."""


@pytest.mark.parametrize("labels", [False, True])
@pytest.mark.parametrize("mode", AutoresetMode)
def test_info_has_the_same_keys_and_types_at_reset_and_at_every_step(mode, labels):
    env = made(3, with_labels=labels, autoreset_mode=mode)
    observations, info = env.reset(seed=5)
    types = {name: values.dtype for name, values in info.items()}
    assert "scenario_index" in types
    assert ("outcome" in types) == labels
    # NumPy's unsigned integers of more than 8 bits have no counterpart in most functions of torch.
    assert {str(dtype) for dtype in types.values()} <= {"bool", "uint8", "int64"}
    num_ended = 0
    for _ in range(60):
        observations, reward, terminated, truncated, info = env.step(wish(observations))
        ended = terminated | truncated
        num_ended += ended.sum()
        assert (observations.dtype, reward.dtype) == (np.float32, np.float64)
        expected_final = FINAL if mode == AutoresetMode.SAME_STEP and ended.any() else set()
        assert set(info) - set(types) == expected_final
        assert {name: info[name].dtype for name in types} == types
        if expected_final:
            assert {name: values.dtype for name, values in info["final_info"].items()} == types
        if mode == AutoresetMode.DISABLED and ended.any():
            observations, info = env.reset(options={"reset_mask": ended})
            assert {name: values.dtype for name, values in info.items()} == types
    assert num_ended > 3


@pytest.mark.parametrize("action", ["decision", "accel_lane", "trajectory"])
@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_as_the_original(action, duplicate):
    env = made(5, action=action, autoreset_mode="NEXT_STEP", reward="progress")
    env.action_space.seed(3)
    env.reset(seed=5)
    actions = [env.action_space.sample() for _ in range(90)]
    endings = 0
    for action_of_step in actions[:50]:
        _, _, terminated, truncated, _ = env.step(action_of_step)
        endings += int((terminated | truncated).sum())
    assert endings > 0  # Episodes of the copy have different ages.
    twin = duplicate(env)
    for action_of_step in actions[50:]:
        expected, observed = env.step(action_of_step), twin.step(action_of_step)
        for value, twin_value in zip(expected[:4], observed[:4], strict=True):
            np.testing.assert_array_equal(value, twin_value)
        np.testing.assert_array_equal(expected[4]["scenario_index"], observed[4]["scenario_index"])


def test_a_copy_of_a_single_environment_goes_on_as_the_original():
    env = single_env(action="decision")
    env.reset(seed=5)
    for _ in range(5):
        env.step(int(ot.Move.PULL_OUT))
    twin = copy.deepcopy(env)
    np.testing.assert_array_equal(env.step(0)[0], twin.step(0)[0])


def test_a_step_in_which_an_episode_ends_is_as_long_as_the_episode():
    """The last step of an episode of 8 s is 2 s long, although actions hold for 3 s."""
    env = made(4, action_repeat=60, reward=step_length, action="decision")
    env.reset(seed=5)
    lengths = np.array([env.step(np.zeros(4, int))[1] for _ in range(3)])
    np.testing.assert_allclose(lengths[:2], 3.0)
    assert (lengths[2] <= 2.05 + 1e-9).all()  # The last decision is the one at 8 s.
    assert (lengths[2] > 0.0).all()


def test_a_step_with_an_accident_has_its_full_length():
    """The observation after the step is that of the wreck at the end of the step."""
    env = made(8, action_repeat=20, reward=step_length, action="accel_steer")
    env.reset(seed=1)
    num_crashes = 0
    while num_crashes == 0:
        _, lengths, terminated, _, info = env.step(np.tile([0.0, 0.02], (8, 1)))
        has_crashed = terminated & (info["stage"] == Stage.CRASHED)
        num_crashes += has_crashed.sum()
        assert (lengths[has_crashed] == 1.0).all()


def step_length(before, action, after, events) -> np.ndarray:
    return events.seconds


def test_the_last_observation_is_that_of_the_end():
    """The last observation of an episode that ends within a step does not depend on `hold`."""
    last_observations = []
    for hold in (1, 20):
        env = made(4, action_repeat=hold, action="decision", autoreset_mode="DISABLED")
        env.reset(seed=5)
        last = {}
        while len(last) < 4:
            observations, _, terminated, truncated, _ = env.step(np.zeros(4, int))
            ended = terminated | truncated
            last |= {row: observations[row] for row in np.flatnonzero(ended) if row not in last}
            env._has_ended[:] = False  # Without this, `step` demands a reset of ended episodes.
        last_observations.append(np.array([last[row] for row in range(4)]))
    np.testing.assert_array_equal(*last_observations)


def picture(env: envs.OvertakingEnv) -> np.ndarray:
    image = env.render()
    assert image is not None
    return image


def test_a_picture_shows_the_present_state():
    env = single_env(render_mode="rgb_array", action="decision")
    env.reset(seed=5)
    pictures = [picture(env)]
    for _ in range(3):
        env.step(0)
        pictures.append(picture(env))
    assert all(image.shape == (400, 1280, 3) for image in pictures)
    assert all(image.dtype == np.uint8 for image in pictures)
    assert all((a != b).any() for a, b in itertools.pairwise(pictures))
    assert single_env().render() is None


@pytest.mark.ci
def test_a_picture_is_that_of_the_film():
    """The road is drawn as `overtaking film` draws it at the same time."""
    scenes = ot.sample(PROFILE, num_simulations=1, seed=5, overrides=SHORT)
    trajectories = ot.drive(
        scenes, lambda _: np.zeros((1, 1)), observation="human", action="decision"
    )
    film = Film(trajectories, title="Simulation 0")
    env = single_env(render_mode="rgb_array", action="decision", action_repeat=20)
    env.reset(seed=5)
    for _ in range(3):
        env.step(0)
    road = np.s_[40:284, :1000]  # The rest has curves over the time so far.
    expected = film.draw(3 * 20).to_rgb()[road]
    np.testing.assert_array_equal(picture(env)[road], expected)


@pytest.mark.ci
def test_gymnasium_records_a_film(tmp_path):
    env = gymnasium.make(
        f"overtaking.gym:overtaking/{PROFILE}-v0", render_mode="rgb_array", **QUICK
    )
    env = RecordVideo(env, str(tmp_path / "films"))
    env.reset(seed=5)
    for _ in range(5):
        env.step(np.zeros(2, np.float32))
    env.close()
    assert [path.suffix for path in (tmp_path / "films").iterdir()] == [".mp4"]


def test_the_names_of_an_observation_are_those_of_its_numbers():
    names = tuple(column.name for column in envs.OBSERVATION_COLUMNS)
    env = gymnasium.make(f"overtaking/{PROFILE}-v0", overrides=SHORT)
    assert env.unwrapped.observation_names == names  # pyright: ignore[reportAttributeAccessIssue]
    assert made(2).observation_names == names
    observation, _ = env.reset(seed=1)
    assert len(names) == len(observation)
