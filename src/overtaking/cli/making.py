"""Makes a data set with any simulator."""

from __future__ import annotations

import sys
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import typer

from overtaking.cli import arguments
from overtaking.core.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from typing import Self

    from overtaking.cli.options import Balancing, Making, RoadChoice
    from overtaking.cli.output import Meter, Output
    from overtaking.data.balance import ClassBalance
    from overtaking.data.estimate import Estimate


def recipe(made: Making, profile: str | None, road: RoadChoice) -> dict[str, Any]:
    """The arguments of `api.generate_dataset` that the user gave.

    Args:
        made: The options of the simulations.
        profile: The profile.
        road: The options that choose the road.
    """
    return arguments.given(
        profile=profile,
        num_simulations=made.num_simulations,
        seed=made.seed,
        keep=made.keep,
        road=arguments.road(road),
        overrides=arguments.overrides(made.changes or [], made.frame_interval_ms),
    )


def choose_profile(argument: str | None, option: str | None) -> str | None:
    """The profile, named by the argument PROFILE or by the option --profile.

    Args:
        argument: Value of PROFILE, None if it is left out.
        option: Value of --profile, None if it is left out.

    Raises:
        ConfigError: Both are given and differ.
    """
    if argument is not None and option is not None and argument != option:
        raise ConfigError(
            what="profile",
            where="generate",
            expected="one profile",
            got=f"{argument} and --profile {option}",
            next_step="leave out one of them",
        )
    return argument if option is None else option


def make(
    output: Output,
    out: str | Path,
    recipe: dict[str, Any],
    made: Making,
    *,
    simulator: str = "engine",
    execution: dict[str, Any] | None = None,
) -> None:
    """Make a data set, or complete one, and print a summary.

    Args:
        output: The output of the command.
        out: Its folder, or its URL.
        recipe: Arguments of `api.generate_dataset`; may be empty to resume.
        made: How to make it.
        simulator: What simulates.
        execution: `executor`, `address` and `workers` of `api.generate_dataset`.
    """
    from overtaking.api import datasets
    from overtaking.cli import summary

    with _Phases(output) as phases:
        talk: dict[str, Any] = {
            "progress": phases.of("simulations"),
            "on_candidates": phases.of("candidates"),
            **(execution or {}),
        }
        if made.resume and not recipe:
            data = datasets.resume_dataset(out, **talk)
        else:
            complete = arguments.DEFAULTS | recipe
            talk |= {"resume": made.resume, "simulator": simulator}
            talk["allow_large"] = _asked(output, made.yes)
            data = datasets.generate_dataset(out=out, **talk, **complete)
    values = summary.of_dataset(data) | output.duration
    output.wrote(values, lambda _: summary.render_generated(values))


def _asked(output: Output, yes: bool) -> Callable[[Estimate], bool]:
    """A function that prints the estimate of a data set, and asks before a large one is made."""

    def is_allowed(found: Estimate) -> bool:
        is_watched = sys.stdin.isatty() and sys.stderr.isatty() and not output.quiet
        is_sure = yes or not found.is_large
        if found.is_long and (is_sure or is_watched):
            output.say(str(found))
        return is_sure or (is_watched and typer.confirm("Go on?", err=True))

    return is_allowed


def balance(asked: Balancing) -> ClassBalance | None:
    """The settings of a balanced data set; None without `--balance`.

    Raises:
        ConfigError: One of them cannot be used, or it is not to be balanced.
    """
    given = {name: one for name, one in asdict(asked).items() if one not in (None, False)}
    if given.pop("balance", False):
        from overtaking.data.balance import ClassBalance

        if "by" in given:
            given["by"] = tuple(name.strip() for name in given["by"].split(","))
        return ClassBalance(**given)
    if given:
        raise ConfigError(
            what=_WORDS[next(iter(given))],
            where="generate",
            expected="--balance beside it",
            got="none",
            next_step="add --balance, or leave it out",
        )
    return None


_WORDS = {
    "by": "--balance-by",
    "policy": "--policy",
    "candidates": "--balance-candidates",
    "allows_missing": "--allow-missing",
}


_STEADY = 10
"""A total is shown anew when it has changed by more than a tenth."""


class _Phases:
    """A progress bar for one phase of the work after the other.

    Args:
        output: Where the bars go.
    """

    def __init__(self, output: Output) -> None:
        """Show nothing yet."""
        self._output = output
        self._shown: tuple[str, Meter] | None = None

    def __enter__(self) -> Self:
        """Begin the work."""
        return self

    def __exit__(self, *_: object) -> None:
        """Take the last bar away."""
        if self._shown:
            self._shown[1].__exit__()

    def of(self, what: str) -> Callable[[int, int], None]:
        """A progress function for one phase.

        Args:
            what: The things of the phase.
        """
        known = 0

        def tell(done: int, total: int) -> None:
            nonlocal known
            # A bar forgets its speed with every new total, and estimates change all the time.
            if done == total or abs(total - known) * _STEADY > known:
                known = total
            if not self._shown or self._shown[0] != what:
                self.__exit__()
                self._shown = what, self._output.progress(what).__enter__()
            self._shown[1](done, max(known, done))

        return tell
