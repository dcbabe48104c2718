"""Environments of Gymnasium in which an agent drives the ego.

All environments of an `OvertakingVectorEnv` run in one batch of the compiled engine. An
`OvertakingEnv` is a batch of one.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

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
from overtaking.sim.controls import CONTROLS
from overtaking.sim.driving import MAX_ACTION_REPEAT, OBSERVATION_SOURCES
from overtaking.world.constants import DECISIONS_PER_SECOND

MAX_ENVS = 1_000_000
MAX_INDEX = 2**62

RENDER_MODES = ("rgb_array",)

_LABEL_DTYPES: dict[str, type[np.generic]] = {
    "outcome": np.uint8,
    "is_legal": np.bool_,
    "num_broken": np.uint8,
}
"""Keys of `info` about episodes that have ended; PyTorch has these types, too."""

Info = dict[str, Any]
EnvStep = tuple[F32, NDArray[np.float64], Mask, Mask, Info]


class OvertakingVectorEnv(VectorEnv[F32, NDArray[Any], Any]):
    """Environments in each of which an agent drives the ego, all in one batch.

    Episode k of environment i has the scenario index first_scenario + i + k n under the seed given
    to `reset`, with n environments. An episode terminates at an accident of the ego or when its
    overtake is over, and is truncated at the horizon, or at the deadline without an attempt.

    `info` has the same keys at every reset and step, each with a mask of the same name after an
    underscore: `scenario_index`; `stage`, the `Stage` of the ego; `num_clipped`, the number of
    actions of the episode outside their limits. With `with_labels` also, where an episode has just
    ended: `outcome`, an `Outcome`; `is_legal`, whether the simulation is legal under the policy
    `default`; `num_broken`, the number of rules of that policy that it breaks.

    Args:
        profile: Profile of the scenarios, as in `overtaking.sample`.
        num_envs: Number of environments.
        observation: `human` for what the model's driver perceives, or `truth`.
        action: Kind of the actions, as in `overtaking.drive`.
        action_repeat: Number of decisions for which an action holds, 20 a second.
        reward: A function, or a name in `REWARDS`; None for 0.
        with_labels: Whether each simulation is labelled at its end. Labels cost more than all steps
            of an episode; some rewards need them.
        normalize: Whether observations are divided by the scales of `OBSERVATION_COLUMNS`.
        first_scenario: Scenario index of the first episode, 0 to 2^62. Training and evaluation
            should not share any index.
        overrides: Dotted keys of the specification with other values.
        road: A road instead of the profile's.
        autoreset_mode: Reaction to the end of an episode: a member of Gymnasium's
            `AutoresetMode`, or its name, such as `SAME_STEP`.
        render_mode: With `rgb_array`, `render` returns the pictures of `overtaking film`;
            with None it draws nothing.

    Raises:
        ConfigError: An argument cannot be used.
        MissingExtraError: `render_mode` is `rgb_array`, and the extra `video` is not installed.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES)}  # noqa: RUF012

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
        check_choice(action, CONTROLS, what="action", where="gym")
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
            options: `reset_mask`, the environments to reset, shape (env,); all if left out.
                `scenario_index`, the scenario indices to begin, one for each environment that is
                reset; the next ones of the sequence if left out.

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
            super().reset(seed=seed)
            self._supply.restart(int(self.np_random.integers(2**63)) if seed is None else seed)
            refs = (
                self._supply.take(rows)
                if scenario_index is None
                else self._supply.draw(scenario_index)
            )
            self._episodes = EpisodeBatch(self._supply, self._settings, refs)
        else:
            self._episodes.restart(rows, scenario_index)
        self._has_ended[mask] = False
        return self._observe(self._episodes), self._describe(self._episodes, None, None)

    def step(self, actions: NDArray[Any]) -> EnvStep:
        """Carry out an action in every environment.

        Args:
            actions: Shape (env, part), or (env,) of `Move`.

        Returns:
            Observations of shape (env, column), with the columns `OBSERVATION_COLUMNS`; rewards,
            which episodes have terminated and which were truncated, each of shape (env,); and
            `info`.

        Raises:
            ConfigError: `reset` was not called before, or the actions have another shape, or in the
                mode DISABLED an environment whose episode has ended was not reset.
        """
        episodes, was_over = self._check_all_running(), self._has_ended.copy()
        clipped = clip_actions(actions, self._settings.action, self.num_envs)
        observation = episodes.observation
        episodes.num_clipped += clipped.was_clipped & episodes.is_running
        episodes.step(clipped.values)
        has_crashed = episodes.has_crashed & ~was_over
        is_done = ~episodes.is_running & (episodes.stage == Stage.DONE)
        terminated = (has_crashed | is_done) & ~was_over
        truncated = ~episodes.is_running & ~terminated & ~was_over
        ended = terminated | truncated
        verdicts = None
        if self._with_labels and ended.any():
            verdicts = episodes.judge(np.flatnonzero(ended))
        outcome = self._outcome(terminated, truncated, has_crashed, verdicts)
        reward = np.zeros(self.num_envs)
        if self._reward is not None:
            next_observation = episodes.observation
            values = self._reward(observation, clipped.values, next_observation, outcome)
            reward = np.where(was_over, 0.0, values)
        info = self._describe(episodes, ended, verdicts)
        if self.autoreset_mode == AutoresetMode.SAME_STEP and ended.any():
            info = self._restart_in_same_step(episodes, ended, info)
            ended = np.zeros_like(ended)
        elif self.autoreset_mode == AutoresetMode.NEXT_STEP and was_over.any():
            episodes.restart(np.flatnonzero(was_over), None)
            info |= self._describe_episodes(episodes)
        self._has_ended = ended
        return self._observe(episodes), reward, terminated, truncated, info

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Draw the present state of each environment, as `overtaking film` draws it.

        Returns:
            A picture of shape (height, width, 3) for each environment; None if the environments
            were made without a render mode.

        Raises:
            ConfigError: `reset` was not called before.
        """
        if self.render_mode is None:
            return None
        episodes = self._check_started("render")
        return tuple(draw_episode(episodes, row) for row in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Free the simulations."""
        del kwargs
        self._episodes = None

    def _check_started(self, where: str) -> EpisodeBatch:
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
        """The episodes, all of which may take a step."""
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
        """The environments to reset, as an array of flags."""
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

    def _outcome(
        self, terminated: Mask, truncated: Mask, has_crashed: Mask, verdicts: EpisodeVerdicts | None
    ) -> StepOutcome:
        assert self._episodes is not None
        ended = terminated | truncated
        is_legal, is_completed = np.zeros((2, self.num_envs), np.bool_)
        if verdicts is not None:
            is_legal[ended], is_completed[ended] = verdicts.is_legal, verdicts.is_completed
        return StepOutcome(
            seconds=self._episodes.num_step_decisions / float(DECISIONS_PER_SECOND),
            terminated=terminated,
            truncated=truncated,
            has_crashed=has_crashed,
            is_judged=ended & self._with_labels,
            is_legal=is_legal,
            is_completed=is_completed,
        )

    def _observe(self, episodes: EpisodeBatch) -> F32:
        return clip_observation(episodes.observations, normalize=self._normalize)

    def _describe_episodes(self, episodes: EpisodeBatch) -> Info:
        """The part of `info` that every episode has at all times."""
        values: dict[str, NDArray[Any]] = {
            "scenario_index": episodes.scenario_index.copy(),
            "stage": episodes.stage.astype(np.uint8),
            "num_clipped": episodes.num_clipped.copy(),
        }
        return values | {f"_{name}": np.ones(self.num_envs, np.bool_) for name in values}

    def _describe(
        self, episodes: EpisodeBatch, ended: Mask | None, verdicts: EpisodeVerdicts | None
    ) -> Info:
        """`info` before the next episodes begin in place of those that have ended."""
        info = self._describe_episodes(episodes)
        if self._with_labels:
            for name, dtype in _LABEL_DTYPES.items():
                info[name], info[f"_{name}"] = (
                    np.zeros(self.num_envs, dtype),
                    np.zeros_like(self._has_ended),
                )
                if verdicts is not None and ended is not None:
                    info[name][ended], info[f"_{name}"][ended] = getattr(verdicts, name), True
        return info

    def _restart_in_same_step(self, episodes: EpisodeBatch, ended: Mask, info: Info) -> Info:
        """Begin episodes where others have ended; `info` keeps the end of those."""
        rows = np.flatnonzero(ended)
        last_observations = np.empty(self.num_envs, object)
        for row, observation in zip(rows, self._observe(episodes)[ended], strict=True):
            last_observations[row] = observation
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
    """An environment in which an agent drives the ego.

    Arguments, episodes and `info` are as in `OvertakingVectorEnv`. The engine computes sixteen
    environments at a time, so the vector environment is faster for training.

    Args:
        profile: Profile of the scenarios, as in `overtaking.sample`.
        **settings: The other arguments of `OvertakingVectorEnv`.

    Raises:
        ConfigError: An argument cannot be used.
        MissingExtraError: `render_mode` is `rgb_array`, and the extra `video` is not installed.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES)}  # noqa: RUF012

    def __init__(self, profile: ProfileSource, **settings: Any) -> None:
        """Check the arguments; `reset` draws the first scenario."""
        self._batch = OvertakingVectorEnv(
            profile, 1, autoreset_mode=AutoresetMode.DISABLED, **settings
        )
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

        Raises:
            ConfigError: There is no episode, or it has ended, or the action has another shape.
        """
        observations, reward, terminated, truncated, info = self._batch.step(
            np.asarray(action)[None]
        )
        return (
            observations[0],
            float(reward[0]),
            bool(terminated[0]),
            bool(truncated[0]),
            _info_of_single(info),
        )

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the present state, as `overtaking film` draws it.

        Returns:
            A picture of shape (height, width, 3); None if the environment was made without a render
            mode.

        Raises:
            ConfigError: `reset` was not called before.
        """
        pictures = self._batch.render()
        return None if pictures is None else pictures[0]

    def close(self) -> None:
        """Free the simulation."""
        self._batch.close()


def make_env(**settings: Any) -> OvertakingEnv:
    """An `OvertakingEnv`, as `gymnasium.make` makes it.

    Gymnasium reads the render modes of a class before it makes an environment, and where `human` is
    not among them it opens a window of its own, which needs pygame. A function has no render modes,
    so the environment itself refuses `human`.
    """
    return OvertakingEnv(**settings)


def draw_episode(episodes: EpisodeBatch, row: int) -> NDArray[np.uint8]:
    """The present state of an episode as a picture, shape (height, width, 3)."""
    from overtaking.show.video.film import Film

    title = f"Simulation {episodes.scenario_index[row]}"
    film = Film(episodes.record(row), title=title)
    return film.draw(film.num_frames - 1).rgb()


def _info_of_single(info: Info) -> Info:
    """The values of the only environment; those that its mask excludes are left out."""
    return {
        name: values[0].item()
        for name, values in info.items()
        if not name.startswith("_") and info[f"_{name}"][0]
    }


def _find_reward(
    reward: str | RewardFunction | None, *, with_labels: bool
) -> RewardFunction | None:
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
    """Pictures per second at which a film runs in real time.

    The number is whole because Gymnasium's video recorders take whole numbers only.
    """
    return max(1, round(float(DECISIONS_PER_SECOND) / action_repeat))


def _check_option_names(options: Mapping[str, Any], allowed: Iterable[str]) -> None:
    for name in options:
        check_choice(name, allowed, what="option", where="reset")


def _check_scenario_index(scenario_index: Any, num_rows: int) -> NDArray[np.uint64]:
    """Scenario indices, one for each environment that is reset."""
    numbers = [whole_number(number) for number in np.atleast_1d(np.asarray(scenario_index))]
    if len(numbers) != num_rows or any(n is None or not 0 <= n <= MAX_INDEX for n in numbers):
        noun = "whole number" if num_rows == 1 else "whole numbers"
        raise _option_error("scenario_index", f"{num_rows} {noun} of 0 to 2^62", scenario_index)
    return np.array(numbers, np.uint64)


def _option_error(option: str, expected: str, value: object) -> ConfigError:
    return ConfigError(
        what=option, where="reset", expected=expected, got=value, next_step="correct the options"
    )
