"""Gymnasium environments in which an agent drives the ego, the vehicle whose overtaking is studied.

All environments of an `OvertakingVectorEnv` run in one batch of the compiled engine: arrays have a
row for each environment, shape (env, ...). An `OvertakingEnv` is a batch of one. An *episode* is
one simulation of an environment, drawn from a *scenario* (road, weather, traffic, and the ego's
start). A step lasts `action_repeat` decisions of 50 ms.

`episodes.EpisodeBatch` runs the simulations; this module adds the interface: checks, rewards, the
dictionary `info`, and what happens when an episode ends.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from gymnasium import Env
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from overtaking.api.simulator_registry import ProfileSource
from overtaking.core.arrays import F32, Mask
from overtaking.core.errors import (
    ConfigError,
    check_choice,
    check_extra,
    check_whole_number,
    whole_number,
)
from overtaking.gym.episodes import EpisodeBatch, EpisodeSettings, EpisodeVerdicts, ScenarioSupply
from overtaking.gym.rewards import NEED_LABELS, REWARDS, RewardFunction, StepOutcome
from overtaking.gym.spaces import (
    OBSERVATION_COLUMNS,
    action_space,
    clip_actions,
    clip_observation,
    observation_space,
)
from overtaking.model.road import Road
from overtaking.model.trajectories import Stage
from overtaking.recordings.roads import resolve_road
from overtaking.scenarios import profiles
from overtaking.scenarios.sampler import MAX_SEED
from overtaking.sim.action_spaces import ACTION_SPACES
from overtaking.sim.external_driver import MAX_ACTION_REPEAT, OBSERVATION_SOURCES
from overtaking.world.constants import DECISIONS_PER_SECOND

MAX_ENVS = 1_000_000
"""Largest number of environments. Chosen: a larger number is a typing error."""

MAX_INDEX = 2**62
"""Largest scenario index of a first episode and of the option `scenario_index` of `reset`.

`info` states indices as int64, which ends at 2^63. The range from 2^62 on is for later episodes.
"""

RENDER_MODES = ("rgb_array",)

_LABEL_DTYPES: dict[str, type[np.generic]] = {
    "outcome": np.uint8,
    "is_legal": np.bool_,
    "num_broken": np.uint8,
}
"""Keys of `info` about episodes that have ended, with the types of their arrays.

The keys are attributes of `EpisodeVerdicts`. The types exist in PyTorch as well, because libraries
turn the arrays into its tensors.
"""

Info = dict[str, Any]
"""Gymnasium's dictionary of additional values."""

EnvStep = tuple[F32, NDArray[np.float64], Mask, Mask, Info]
"""Observations, rewards, terminated, truncated, and `info`."""


class _EpisodeEnds(NamedTuple):
    """Episodes that end in a step; each mask has shape (env,).

    Attributes:
        terminated: By an accident of the ego, or because its overtake is over.
        truncated: At the horizon, or at the deadline by which an overtake has to begin.
        has_crashed: By an accident; a part of `terminated`.
    """

    terminated: Mask
    truncated: Mask
    has_crashed: Mask

    @property
    def has_ended(self) -> Mask:
        """Terminated or truncated."""
        return self.terminated | self.truncated


# In brackets: the types of observations, actions and other arrays.
class OvertakingVectorEnv(VectorEnv[F32, NDArray[Any], Any]):
    """Environments in each of which an agent drives the ego, all in one batch.

    Episode k of environment i has the scenario index first_scenario + i + k n, with n environments;
    the index and the seed given to `reset` determine the scenario. An episode terminates at an
    accident of the ego or some seconds after its overtake. It is truncated when the simulated time
    is at its end (the horizon), or at the deadline by which an overtake has to begin.

    `info` has the same keys at every reset and step, each an array of shape (env,):
    `scenario_index`; `stage`, the `Stage` of the ego's overtake; `num_clipped`, the number of
    actions of the episode outside their limits. With `with_labels` also, where an episode has just
    ended: `outcome`, an `Outcome`; `is_legal`, whether the simulation breaks no rule of the policy
    `default` (a set of traffic rules); `num_broken`, the number of these rules that it breaks. For
    each key, a mask with an underscore before its name (`_outcome`) says where it has a value.

    Args:
        profile: Profile of the scenarios: a name, a TOML file, or a specification.
        num_envs: Number of environments, 1 to `MAX_ENVS`.
        observation: `human` for the perception of a human driver, or `truth` for the exact state.
        action: Kind of the actions, a key of `ACTION_SPACES`, such as `accel_lane` (acceleration
            and lane change) or `decision` (one of `Move`).
        action_repeat: Number of decisions of 50 ms for which an action holds, the duration of a
            step, 1 to 200.
        reward: A function like those in `rewards`, or a name in `REWARDS`; None for rewards of 0.
        with_labels: Whether each simulation is labelled (judged by the traffic rules) at its end.
            Labels cost more time than all steps of an episode; some rewards need them.
        normalize: Whether observations are divided by the scales of `OBSERVATION_COLUMNS`.
        first_scenario: Scenario index of the first episode, 0 to 2^62. Training and evaluation with
            the same seed should not share any index.
        overrides: New values of keys of the specification, such as
            `{"traffic.vehicles": "2..6"}`.
        road: A road instead of the profile's: a name, an OpenDRIVE file, or a `Road`.
        autoreset_mode: A member of Gymnasium's `AutoresetMode`, or its name. When an episode ends,
            the next one begins in the next step, whose action is ignored (`NEXT_STEP`), within the
            same step (`SAME_STEP`), or at a call of `reset` (`DISABLED`).
        render_mode: With `rgb_array`, `render` returns pictures like the command `overtaking film`;
            with None it returns None.

    Raises:
        ConfigError: An argument cannot be used.
        MissingExtraError: `render_mode` is `rgb_array`, and the extra `video` is not installed.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES)}  # noqa: RUF012 - Gymnasium's type.

    def __init__(
        self,
        profile: ProfileSource,
        num_envs: int = 1,
        *,
        observation: str = "human",
        action: str = "accel_lane",
        action_repeat: int = 1,
        reward: str | RewardFunction | None = None,
        with_labels: bool = False,
        normalize: bool = False,
        first_scenario: int = 0,
        overrides: Mapping[str, Any] | None = None,
        road: str | Path | Road | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
    ) -> None:
        """Check the arguments; `reset` draws the first scenarios."""
        check_choice(observation, OBSERVATION_SOURCES, what="observation", where="gym")
        check_choice(action, ACTION_SPACES, what="action", where="gym")
        num_envs = check_whole_number(num_envs, 1, MAX_ENVS, what="num_envs", where="gym")
        action_repeat = check_whole_number(
            action_repeat, 1, MAX_ACTION_REPEAT, what="action_repeat", where="gym"
        )
        first_scenario = check_whole_number(
            first_scenario, 0, MAX_INDEX, what="first_scenario", where="gym"
        )
        self._reward = _find_reward(reward, with_labels=with_labels)
        _check_render_mode(render_mode)
        spec = profiles.load_specification(profile, overrides)
        self._supply = ScenarioSupply(
            spec, resolve_road(road or spec.road), num_envs=num_envs, first_scenario=first_scenario
        )
        self._settings = EpisodeSettings(
            num_envs=num_envs,
            action=action,
            action_repeat=action_repeat,
            observes_truth=observation == "truth",
        )
        self._with_labels, self._normalize = with_labels, normalize
        self._episodes: EpisodeBatch | None = None
        self.num_envs, self.render_mode = num_envs, render_mode
        self.autoreset_mode = _parse_autoreset_mode(autoreset_mode)
        self.metadata = {
            "autoreset_mode": self.autoreset_mode,
            "render_modes": list(RENDER_MODES),
            "render_fps": _frames_per_second(action_repeat),
        }
        self.single_observation_space = observation_space(normalize=normalize)
        self.single_action_space = action_space(action)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        # Environments whose episode ended in the last step and was not yet replaced, shape (env,).
        self._has_ended = np.zeros(num_envs, np.bool_)

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Name of each number of an observation, such as `leader.gap`, in order."""
        return tuple(column.name for column in OBSERVATION_COLUMNS)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[F32, Info]:
        """Begin new episodes.

        Args:
            seed: Seed of the scenarios. With None the sequence of episodes continues; at the first
                reset the system provides a seed.
            options: `reset_mask`, the environments to reset, boolean of shape (env,); all if left
                out. `scenario_index`, the scenario indices to begin, one for each environment that
                is reset; the next ones of the sequence if left out. A chosen index does not
                advance the sequence.

        Returns:
            Observations of all environments, shape (env, column), and `info`.

        Raises:
            ConfigError: An option is unknown or cannot be used, or a seed is given for some
                environments only.
        """
        options = options or {}
        if seed is not None:
            seed = check_whole_number(seed, 0, MAX_SEED, what="seed", where="reset")
        _check_option_names(options, ("reset_mask", "scenario_index"))
        mask = self._check_mask(options.get("reset_mask"), seed)
        rows = np.flatnonzero(mask)
        scenario_index = None
        if "scenario_index" in options:
            scenario_index = _check_scenario_index(options["scenario_index"], len(rows))
        if seed is not None or self._episodes is None:
            super().reset(seed=seed)  # Seeds Gymnasium's generator `np_random`.
            if seed is None:  # The generator then has a random seed of the system; it draws int64.
                seed = int(self.np_random.integers(2**63))
            self._supply.restart(seed)
            if scenario_index is None:
                scenarios = self._supply.take(rows)
            else:
                scenarios = self._supply.draw(scenario_index)
            self._episodes = EpisodeBatch(self._supply, self._settings, scenarios)
        else:
            self._episodes.restart(rows, scenario_index)
        self._has_ended[mask] = False
        return self._observe(self._episodes), self._describe(self._episodes, None, None)

    def step(self, actions: NDArray[Any]) -> EnvStep:
        """Carry out an action in every environment.

        Args:
            actions: Shape (env, part), or (env,) for a kind with one part, such as `Move`. Values
                outside the limits of a part are clipped.

        Returns:
            Observations of shape (env, column), with the columns `OBSERVATION_COLUMNS`; rewards,
            terminated and truncated, each of shape (env,); and `info`.

        Raises:
            ConfigError: `reset` was not called before, the actions have another shape or are not
                finite, or in the mode DISABLED an environment whose episode has ended was not
                reset.
        """
        episodes = self._check_all_running()
        # Episodes that ended in the previous step (mode NEXT_STEP). This step ignores their
        # actions, and the next episodes begin at its end.
        was_over = self._has_ended
        clipped = clip_actions(actions, self._settings.action, self.num_envs)
        # The reward reads the agent's observations before clipping and normalization, so its units
        # do not depend on `normalize`. `episodes.step` makes new arrays, so these values stay.
        observation = episodes.ego_observation
        episodes.num_clipped += clipped.was_clipped & episodes.is_running
        episodes.step(clipped.values)
        ends = _find_ends(episodes, was_over)
        ended = ends.has_ended
        verdicts = None
        if self._with_labels and ended.any():
            verdicts = episodes.judge(np.flatnonzero(ended))
        reward = np.zeros(self.num_envs)
        if self._reward is not None:
            step_outcome = self._step_outcome(ends, verdicts)
            next_observation = episodes.ego_observation
            values = self._reward(observation, clipped.values, next_observation, step_outcome)
            # In the mode NEXT_STEP the step after an end only begins the next episode.
            reward = np.where(was_over, 0.0, values)
        info = self._describe(episodes, ended, verdicts)
        self._has_ended = ended
        if self.autoreset_mode == AutoresetMode.SAME_STEP and ended.any():
            info = self._restart_in_same_step(episodes, ended, info)
            self._has_ended = np.zeros_like(ended)  # All are replaced.
        elif self.autoreset_mode == AutoresetMode.NEXT_STEP and was_over.any():
            episodes.restart(np.flatnonzero(was_over), None)
            # The index, stage and counts of the new episodes; labels of other rows stay.
            info |= self._describe_episodes(episodes)
        return self._observe(episodes), reward, ends.terminated, ends.truncated, info

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Draw the present state of each environment from above, as `overtaking film` draws it.

        Returns:
            A picture for each environment, RGB of shape (height, width, 3); None if the
            environments were made without a render mode.

        Raises:
            ConfigError: `reset` was not called before.
        """
        if self.render_mode is None:
            return None
        episodes = self._check_started("render")
        return tuple(draw_episode(episodes, row) for row in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Free the memory of the simulations; Gymnasium's `close` calls this."""
        del kwargs
        self._episodes = None

    def _check_started(self, where: str) -> EpisodeBatch:
        """Return the episodes; raise a `ConfigError` before the first reset."""
        if self._episodes is None:
            raise ConfigError(
                what="episodes",
                where=where,
                expected="one in every environment",
                got="none",
                next_step="call reset first",
            )
        return self._episodes

    def _check_all_running(self) -> EpisodeBatch:
        """Return the episodes; raise a `ConfigError` if the caller must first reset some."""
        episodes = self._check_started("step")
        if self.autoreset_mode == AutoresetMode.DISABLED and self._has_ended.any():
            raise ConfigError(
                what="episodes",
                where="step",
                expected="one in every environment",
                got=f"{int(self._has_ended.sum())} that have ended",
                next_step='call reset, with options={"reset_mask": mask} for some of them',
            )
        return episodes

    def _check_mask(self, reset_mask: Any, seed: int | None) -> Mask:
        """The environments to reset, as a mask of shape (env,).

        All share the seed, so only all together can be reset with a new seed.
        """
        if reset_mask is None:
            return np.ones(self.num_envs, np.bool_)
        mask = np.asarray(reset_mask)
        if mask.shape != (self.num_envs,) or mask.dtype != bool or not mask.any():
            expected = f"a mask of {self.num_envs} environments, true for at least one"
            raise _option_error("reset_mask", expected, f"{mask.dtype} of shape {mask.shape}")
        if (seed is not None or self._episodes is None) and not mask.all():
            expected = "all environments at the first reset and at a reset with a seed"
            raise _option_error("reset_mask", expected, "some of them")
        return mask

    def _step_outcome(self, ends: _EpisodeEnds, verdicts: EpisodeVerdicts | None) -> StepOutcome:
        """The outcome of the last step, which rewards read; `verdicts` has a value for each end."""
        assert self._episodes is not None
        ended = ends.has_ended
        is_legal, is_completed = np.zeros((2, self.num_envs), np.bool_)
        if verdicts is not None:
            is_legal[ended], is_completed[ended] = verdicts.is_legal, verdicts.is_completed
        return StepOutcome(
            seconds=self._episodes.num_step_decisions / float(DECISIONS_PER_SECOND),
            terminated=ends.terminated,
            truncated=ends.truncated,
            has_crashed=ends.has_crashed,
            is_judged=ended & self._with_labels,
            is_legal=is_legal,
            is_completed=is_completed,
        )

    def _observe(self, episodes: EpisodeBatch) -> F32:
        """Observations as the agent gets them, shape (env, column)."""
        return clip_observation(episodes.observation_table, normalize=self._normalize)

    def _describe_episodes(self, episodes: EpisodeBatch) -> Info:
        """The part of `info` with a value for every environment, and its masks."""
        values: dict[str, NDArray[Any]] = {
            "scenario_index": episodes.scenario_index.copy(),
            "stage": episodes.stage.astype(np.uint8),
            "num_clipped": episodes.num_clipped.copy(),
        }
        return values | {f"_{name}": np.ones(self.num_envs, np.bool_) for name in values}

    def _describe(
        self, episodes: EpisodeBatch, ended: Mask | None, verdicts: EpisodeVerdicts | None
    ) -> Info:
        """All of `info`, before any ended episode is replaced.

        Args:
            episodes: The episodes.
            ended: Episodes that ended in this step, shape (env,); None at a reset.
            verdicts: Labels of these episodes; None without labels or without ends.
        """
        info = self._describe_episodes(episodes)
        if self._with_labels:
            for name, dtype in _LABEL_DTYPES.items():
                values, mask = np.zeros(self.num_envs, dtype), np.zeros(self.num_envs, np.bool_)
                if verdicts is not None and ended is not None:
                    values[ended], mask[ended] = getattr(verdicts, name), True
                info[name], info[f"_{name}"] = values, mask
        return info

    def _restart_in_same_step(self, episodes: EpisodeBatch, ended: Mask, info: Info) -> Info:
        """Replace ended episodes in the mode SAME_STEP.

        Args:
            episodes: The episodes.
            ended: Episodes that ended in this step, shape (env,).
            info: `info` of the step so far.

        Returns:
            `info` of the new episodes. The last observations and the `info` of the ended ones are
            in `final_obs` and `final_info`, as Gymnasium defines.
        """
        rows = np.flatnonzero(ended)
        last_observations = np.empty(self.num_envs, object)
        for row, observation in zip(rows, self._observe(episodes)[ended], strict=True):
            last_observations[row] = observation
        # Names with an underscore are masks; in `final_info` they are true for ended episodes only.
        final_info = {
            name: values & ended if name.startswith("_") else values
            for name, values in info.items()
        }
        episodes.restart(rows, None)
        return {
            "final_obs": last_observations,
            "_final_obs": ended.copy(),
            "final_info": final_info,
            "_final_info": ended.copy(),
            **self._describe(episodes, None, None),
        }


class OvertakingEnv(Env[F32, Any]):
    """A single environment in which an agent drives the ego.

    Episodes are as in `OvertakingVectorEnv`; `info` holds plain numbers, and only the keys that
    have a value. For training the vector environment is faster, because one processor core computes
    up to sixteen simulations at once (a number for each in a vector register).

    Args:
        profile: Profile of the scenarios: a name, a TOML file, or a specification.
        **settings: Other arguments of `OvertakingVectorEnv`, without `num_envs` and
            `autoreset_mode`.

    Raises:
        ConfigError: An argument cannot be used.
        MissingExtraError: `render_mode` is `rgb_array`, and the extra `video` is not installed.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES)}  # noqa: RUF012 - Gymnasium's type.

    def __init__(self, profile: ProfileSource, **settings: Any) -> None:
        """Check the arguments; `reset` draws the first scenario."""
        self._batch = OvertakingVectorEnv(
            profile, 1, autoreset_mode=AutoresetMode.DISABLED, **settings
        )
        # Without `autoreset_mode`, which Gymnasium defines for vector environments only.
        self.metadata = {
            name: value
            for name, value in self._batch.metadata.items()
            if name.startswith("render_")
        }
        self.render_mode = self._batch.render_mode
        self.observation_space = self._batch.single_observation_space
        self.action_space = self._batch.single_action_space

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Name of each number of an observation, such as `leader.gap`, in order."""
        return self._batch.observation_names

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[F32, Info]:
        """Begin a new episode.

        Args:
            seed: Seed of the scenarios. With None the sequence of episodes continues; at the first
                reset the system provides a seed.
            options: `scenario_index`, the scenario index to begin; the next one of the sequence if
                left out.

        Returns:
            The observation, shape (column,), and `info`.

        Raises:
            ConfigError: An option is unknown or cannot be used.
        """
        if seed is not None:
            seed = check_whole_number(seed, 0, MAX_SEED, what="seed", where="reset")
        super().reset(seed=seed)
        _check_option_names(options or {}, ("scenario_index",))
        observations, info = self._batch.reset(seed=seed, options=options)
        return observations[0], _info_of_single(info)

    def step(self, action: NDArray[Any] | int) -> tuple[F32, float, bool, bool, Info]:
        """Carry out an action.

        Args:
            action: Shape (part,), or a number for a kind with one part, such as `Move`.

        Returns:
            Observation of shape (column,), reward, terminated, truncated, and `info`.

        Raises:
            ConfigError: There is no episode, it has ended, or the action has another shape or is
                not finite.
        """
        batch_of_one = np.asarray(action)[None]
        observations, reward, terminated, truncated, info = self._batch.step(batch_of_one)
        return (
            observations[0],
            float(reward[0]),
            bool(terminated[0]),
            bool(truncated[0]),
            _info_of_single(info),
        )

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the present state from above, as `overtaking film` draws it.

        Returns:
            A picture, RGB of shape (height, width, 3); None if the environment was made without a
            render mode.

        Raises:
            ConfigError: `reset` was not called before.
        """
        pictures = self._batch.render()
        return None if pictures is None else pictures[0]

    def close(self) -> None:
        """Free the memory of the simulation."""
        self._batch.close()


def _find_ends(episodes: EpisodeBatch, was_over: Mask) -> _EpisodeEnds:
    """Episodes that ended in the last step.

    An accident ends the episode with the step in which it happens, although the engine would
    simulate two more seconds. Labels judge the whole simulation, with these two seconds.

    Args:
        episodes: The episodes after the step.
        was_over: Episodes that had ended before it and were not replaced, shape (env,).
    """
    has_crashed = episodes.has_crashed & ~was_over
    # The stage DONE begins when the ego has returned. The simulation then goes on for
    # `ModelConstants.after_overtake`, because some rules judge the time after the return. An
    # episode whose simulation reaches the horizon in this time counts as terminated.
    is_done = ~episodes.is_running & (episodes.stage == Stage.DONE)
    terminated = has_crashed | (is_done & ~was_over)
    truncated = ~episodes.is_running & ~terminated & ~was_over
    return _EpisodeEnds(terminated, truncated, has_crashed)


def make_env(**settings: Any) -> OvertakingEnv:
    """Make an `OvertakingEnv`; `gymnasium.make` calls this function instead of the class.

    If Gymnasium called the class, it would find that the mode `human` is not in its
    `metadata["render_modes"]`, and would open a window of its own, which needs pygame. A function
    has no such metadata, so the environment itself refuses `human` with a clear error.
    """
    return OvertakingEnv(**settings)


def draw_episode(episodes: EpisodeBatch, row: int) -> NDArray[np.uint8]:
    """The present state of the episode in a row, as an RGB picture of shape (height, width, 3).

    The engine keeps only the present state, so the episode is simulated again up to now, and the
    last frame of its film is drawn.
    """
    from overtaking.show.video.film import Film

    title = f"Simulation {episodes.scenario_index[row]}"
    film = Film(episodes.record(row), title=title)
    return film.draw(film.num_frames - 1).to_rgb()


def _info_of_single(info: Info) -> Info:
    """`info` of the only environment as plain numbers, without masks and without missing values."""
    return {
        name: values[0].item()
        for name, values in info.items()
        if not name.startswith("_") and info[f"_{name}"][0]
    }


def _find_reward(
    reward: str | RewardFunction | None, *, with_labels: bool
) -> RewardFunction | None:
    """The reward function of a name; a function or None is returned unchanged.

    Raises:
        ConfigError: There is no such name, or the reward needs labels, which are off.
    """
    if isinstance(reward, str):
        check_choice(reward, REWARDS, what="reward", where="gym")
        reward = REWARDS[reward]
    if reward is not None and reward in NEED_LABELS and not with_labels:
        raise ConfigError(
            what="with_labels",
            where="gym",
            expected=f"True for the reward {reward.__name__}",
            got=with_labels,
            next_step="set with_labels=True",
        )
    return reward


def _check_render_mode(render_mode: str | None) -> None:
    """Raise an error if the mode is unknown, or if the package that draws is missing."""
    if render_mode is None:
        return
    if render_mode not in RENDER_MODES:
        raise ConfigError(
            what="render_mode",
            where="gym",
            expected=f"{' or '.join(RENDER_MODES)}, or None",
            got=render_mode,
            next_step="show the pictures of rgb_array with a tool of your own",
        )
    check_extra("video", "PIL", what="Pillow", where="render_mode='rgb_array'")


def _parse_autoreset_mode(mode: str | AutoresetMode) -> AutoresetMode:
    """A mode by its name, such as `NEXT_STEP`, or by Gymnasium's value, such as `NextStep`."""
    for member in AutoresetMode:
        if mode in (member, member.name, member.value):
            return member
    names = [member.name for member in AutoresetMode]
    raise ConfigError.unknown_choice(what="autoreset_mode", where="gym", choices=names, got=mode)


def _frames_per_second(action_repeat: int) -> int:
    """Pictures per second at which a film with a picture for each step runs in real time.

    At least 1 and rounded, because Gymnasium's video recorders take whole numbers only; a film with
    more than 20 decisions a step therefore runs too fast.
    """
    return max(1, round(float(DECISIONS_PER_SECOND) / action_repeat))


def _check_option_names(options: Mapping[str, Any], allowed: Iterable[str]) -> None:
    """Raise a `ConfigError` for an unknown option of `reset`."""
    for name in options:
        check_choice(name, allowed, what="option", where="reset")


def _check_scenario_index(scenario_index: Any, num_rows: int) -> NDArray[np.uint64]:
    """The option `scenario_index` as an array, one for each environment that is reset.

    A number is accepted for one environment.

    Raises:
        ConfigError: There are more or fewer numbers, or one is not whole or out of range.
    """
    # `whole_number` gives None for a value that is no whole number.
    numbers = [whole_number(number) for number in np.atleast_1d(np.asarray(scenario_index))]
    if len(numbers) != num_rows or any(n is None or not 0 <= n <= MAX_INDEX for n in numbers):
        noun = "whole number" if num_rows == 1 else "whole numbers"
        raise _option_error("scenario_index", f"{num_rows} {noun} of 0 to 2^62", scenario_index)
    return np.array(numbers, np.uint64)


def _option_error(option: str, expected: str, value: object) -> ConfigError:
    """The error for an invalid value of an option of `reset`."""
    return ConfigError(
        what=option, where="reset", expected=expected, got=value, next_step="correct the options"
    )
