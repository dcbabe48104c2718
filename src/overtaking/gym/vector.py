"""Many environments in one batch of the compiled engine, as Gymnasium's vector environments."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from overtaking import scenarios
from overtaking.api.choices import Profile, road_of
from overtaking.core.arrays import F32, Mask
from overtaking.core.checks import check_name
from overtaking.core.errors import ConfigError
from overtaking.gym.rewards import REWARDS, Events, Reward
from overtaking.gym.rows import Rows, Verdicts
from overtaking.gym.spaces import action_space, answers, bounded, observation_space
from overtaking.gym.supply import Supply
from overtaking.model.road import Road
from overtaking.model.trajectory import Stage
from overtaking.sim.controls import CONTROLS
from overtaking.sim.driving import MOST_HELD, OBSERVED
from overtaking.world.clock import DECISIONS_PER_SECOND

MOST_ENVS = 1_000_000

Info = dict[str, Any]
Stepped = tuple[F32, NDArray[np.float64], Mask, Mask, Info]


class OvertakingVectorEnv(VectorEnv[F32, NDArray[Any], Any]):
    """Environments in each of which a policy drives the ego, all in one batch.

    Episode k of environment i is simulation number first + i + k n, of the seed given to `reset`. A
    simulation terminates when the ego has an accident or its overtake is over, and is truncated at
    the horizon, or at the deadline without an attempt.

    At the end of an episode `info` holds, each with a mask of the same name after an underscore:
    `index`, the number of the simulation; `stage`, the last `Stage`; `clipped`, how many of its
    actions were beyond the limits of a part; and with `labels` also `outcome`, an `Outcome`,
    `legal`, whether it is legal under the policy `default`, and `broken`, how many of its rules are
    broken.

    Args:
        profile: What to sample, as in `overtaking.sample`.
        num_envs: How many environments.
        observe: `human` for what the model's driver believes, or `truth`.
        action: What is answered, as in `overtaking.drive`.
        hold: Decisions for which an answer holds, 20 a second.
        reward: A function, or a name in `REWARDS`; None for 0.
        labels: Whether each simulation is labelled at its end, which costs a tenth of a second.
        scaled: Whether observations are divided by the scales of `COLUMNS`.
        first: Number of the first simulation: training and evaluation should not share any.
        overrides: Dotted keys of the specification with other values.
        road: A road instead of the profile's.
        autoreset_mode: What happens after the end of an episode, as Gymnasium defines it.
        render_mode: None; films are drawn of data sets.

    Raises:
        ConfigError: An argument cannot be used.
    """

    def __init__(
        self,
        profile: Profile,
        num_envs: int = 1,
        *,
        observe: str,
        action: str = "accel_lane",
        hold: int = 1,
        reward: str | Reward | None = None,
        labels: bool = True,
        scaled: bool = False,
        first: int = 0,
        overrides: Mapping[str, Any] | None = None,
        road: str | Path | Road | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: None = None,
    ) -> None:
        """Check what is asked for; `reset` draws the first scenarios."""
        check_name(observe, OBSERVED, what="observe", where="gym")
        check_name(action, CONTROLS, what="action", where="gym")
        _check_range("num_envs", num_envs, 1, MOST_ENVS)
        _check_range("hold", hold, 1, MOST_HELD)
        _check_range("first", first, 0, 2**62)
        if isinstance(reward, str):
            check_name(reward, REWARDS, what="reward", where="gym")
        spec = scenarios.spec(profile, overrides)
        self._supply = Supply(spec, road_of(road or spec.road), count=num_envs, first=first)
        self._settings: dict[str, Any] = {
            "count": num_envs,
            "action": action,
            "hold": hold,
            "is_true": observe == "truth",
            "logs": labels,
        }
        self._reward = REWARDS[reward] if isinstance(reward, str) else reward
        self._action, self._labels, self._scaled = action, labels, scaled
        self._seconds = hold / float(DECISIONS_PER_SECOND)
        self._rows: Rows | None = None
        self.num_envs, self.render_mode = num_envs, render_mode
        self._mode = AutoresetMode(autoreset_mode)
        self.metadata = {"autoreset_mode": self._mode, "render_modes": []}
        self.single_observation_space = observation_space(scaled=scaled)
        self.single_action_space = action_space(action)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._ended = np.zeros(num_envs, np.bool_)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[F32, Info]:
        """Begin new episodes.

        Args:
            seed: Seed of the scenarios; with None the episodes that follow those before, or a seed
                from the system at first.
            options: `reset_mask`, the environments to reset, shape (environment,); all if left out.

        Raises:
            ConfigError: The mask is none, or a seed is given for some environments only.
        """
        mask = self._mask((options or {}).get("reset_mask"), seed)
        if seed is not None or self._rows is None:
            super().reset(seed=seed)
            self._supply.begin(int(self.np_random.integers(2**63)) if seed is None else seed)
            self._rows = Rows(self._supply, **self._settings)
        else:
            self._rows.renew(np.flatnonzero(mask))
        self._ended[mask] = False
        return self._observed(self._rows), self._told(mask)

    def step(self, actions: NDArray[Any]) -> Stepped:
        """Carry out an action in every environment.

        Args:
            actions: Shape (environment, part), or (environment,) of `Move`.

        Returns:
            Observations, rewards, which have terminated, which were truncated, and `info`.

        Raises:
            ConfigError: `reset` was not called before, or an environment that has ended was not
                reset in the mode DISABLED, or the actions are none.
        """
        rows, waiting = self._running(), self._ended.copy()
        answer, beyond = answers(actions, self._action, self.num_envs)
        before = rows.seen
        rows.clipped += beyond & rows.runs
        rows.go_on(answer)
        crashed = rows.crashed & ~waiting
        terminated = (crashed | (~rows.runs & (rows.stage == Stage.DONE))) & ~waiting
        truncated = ~rows.runs & ~terminated & ~waiting
        ended = terminated | truncated
        verdicts = rows.judge(np.flatnonzero(ended)) if self._labels and ended.any() else None
        events = self._events(terminated, truncated, crashed, verdicts)
        reward = np.zeros(self.num_envs)
        if self._reward is not None:
            reward = np.where(waiting, 0.0, self._reward(before, answer, rows.seen, events))
        info = self._endings(rows, ended, verdicts)
        if self._mode == AutoresetMode.SAME_STEP:
            info = self._begun_at_once(rows, ended, info)
        elif self._mode == AutoresetMode.NEXT_STEP and waiting.any():
            rows.renew(np.flatnonzero(waiting))
        self._ended = ended if self._mode != AutoresetMode.SAME_STEP else np.zeros_like(ended)
        return self._observed(rows), reward, terminated, truncated, info

    def _running(self) -> Rows:
        """The simulations, all of which may take a step."""
        if self._rows is None or (self._mode == AutoresetMode.DISABLED and self._ended.any()):
            got = "none" if self._rows is None else f"{int(self._ended.sum())} that have ended"
            raise ConfigError.of(
                what="episodes",
                where="step",
                expected="one in every environment",
                got=got,
                next_step='call reset, with options={"reset_mask": mask} for some of them',
            )
        return self._rows

    def _mask(self, given: Any, seed: int | None) -> Mask:
        """Which environments to reset."""
        if given is None:
            return np.ones(self.num_envs, np.bool_)
        mask = np.asarray(given)
        if mask.shape != (self.num_envs,) or mask.dtype != bool or not mask.any():
            expected = f"true or false for each of {self.num_envs} environments, one true at least"
            raise _refused("reset_mask", expected, f"{mask.dtype} of shape {mask.shape}")
        if (seed is not None or self._rows is None) and not mask.all():
            raise _refused("reset_mask", "all environments at first, and with a seed", "some")
        return mask

    def _events(
        self, terminated: Mask, truncated: Mask, crashed: Mask, verdicts: Verdicts | None
    ) -> Events:
        ended, legal = terminated | truncated, np.zeros(self.num_envs, np.bool_)
        if verdicts is not None:
            legal[ended] = verdicts.legal
        return Events(
            seconds=self._seconds,
            terminated=terminated,
            truncated=truncated,
            crashed=crashed,
            judged=ended & self._labels,
            legal=legal,
        )

    def _observed(self, rows: Rows) -> F32:
        return bounded(rows.table, scaled=self._scaled)

    def _told(self, mask: Mask) -> Info:
        """The numbers of simulations that have begun."""
        assert self._rows is not None
        return {"index": self._rows.index.copy(), "_index": mask.copy()}

    def _endings(self, rows: Rows, ended: Mask, verdicts: Verdicts | None) -> Info:
        """What is known of simulations that have ended."""
        if not ended.any():
            return {}
        found: dict[str, NDArray[Any]] = {
            "index": rows.index.copy(),
            "stage": rows.stage.astype(np.uint8),
            "clipped": rows.clipped.copy(),
        }
        if verdicts is not None:
            for name in ("outcome", "legal", "broken"):
                values = getattr(verdicts, name)
                found[name] = np.zeros(self.num_envs, values.dtype)
                found[name][ended] = values
        return found | {f"_{name}": ended.copy() for name in found}

    def _begun_at_once(self, rows: Rows, ended: Mask, info: Info) -> Info:
        """The endings with the last observations, and new episodes in their place."""
        if not ended.any():
            return {}
        last = np.empty(self.num_envs, object)
        for row, numbers in zip(np.flatnonzero(ended), self._observed(rows)[ended], strict=True):
            last[row] = numbers
        rows.renew(np.flatnonzero(ended))
        final = {"final_obs": last, "final_info": info}
        begun = {"index": rows.index.copy(), "_index": ended.copy()}
        return final | {f"_{name}": ended.copy() for name in final} | begun


def _check_range(name: str, value: object, least: int, most: int) -> None:
    if not (isinstance(value, int) and least <= value <= most):
        raise ConfigError.out_of_range(name, "gym", least, most, value)


def _refused(what: str, expected: str, got: object) -> ConfigError:
    return ConfigError.of(
        what=what, where="reset", expected=expected, got=got, next_step="correct the options"
    )
