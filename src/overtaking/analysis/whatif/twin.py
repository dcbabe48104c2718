"""Twins: a simulation as it was, and the same with something changed, side by side."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.result_methods import Plottable
from overtaking.analysis.whatif.scenes import Scene, pull_out
from overtaking.core.equality import ContentEquality
from overtaking.core.errors import ConfigError, check_choice
from overtaking.data.branches import Told
from overtaking.labels.labelling import LabelledTrajectories, label
from overtaking.model.scenario import ForcedDecision, Intervention
from overtaking.model.trajectories import STATE_RESOLUTION, States, Trajectories
from overtaking.model.vehicles import EGO_SLOT

MOST_DELAY = 60.0
"""Longest delay of a start [s]."""

_LAMPS = "lights"

_STEADY = 40
"""Decisions before the wanted start from which one is forced: no indicator is on for longer."""


class Effect(StrEnum):
    """Which difference a twin shows."""

    DIRECT = "direct"
    """From a state on: everything before it, and everything that was drawn, is as it was."""
    TOTAL = "total"
    """From the start: what depends on the change is drawn again from the same random numbers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parting(ContentEquality):
    """The first frame in which two simulations move differently.

    Attributes:
        frame: The frame.
        time: Its time [s].
        vehicle: Slot of a vehicle that differs there; the ego if it does.
        quantity: Which of its recorded numbers differs, a name in `States`.
        by: How much the second one has more, in SI units.
        ego_time: First time at which the ego is another one; None if it never is [s].
    """

    frame: int
    time: float
    vehicle: int
    quantity: str
    by: float
    ego_time: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Twin(ContentEquality, Plottable):
    """A simulation and its twin.

    Attributes:
        number: Number of the simulation in its data set.
        title: What is different, in a few words.
        effect: What the difference of the two is.
        since: First time that the change can affect [s].
        told: Both simulations, the one as it was first.
        labelled: Both with their labels.
        parting: The first frame in which they move differently; None if they never do.
        begins: When the ego pulls out as it was and in the twin; None where it never does [s].
        lamps: First time at which lamps differ, as they do at once without rain; None if never [s].
    """

    number: int
    title: str
    effect: Effect
    since: float
    told: tuple[Told, Told]
    labelled: tuple[LabelledTrajectories, LabelledTrajectories]
    parting: Parting | None
    begins: tuple[float | None, float | None]
    lamps: float | None

    @property
    def profile(self) -> str:
        """Name of the profile of the simulation."""
        return self.told[0].run.scenario.profile


@dataclass(frozen=True, slots=True, kw_only=True)
class Wish:
    """What a twin shall have different.

    Attributes:
        without: What is taken away from the weather, names in `model.weather.REMOVABLE_FACTORS`.
        driving_style: Driving style of the ego, from `scenes.DRIVING_STYLES`; None for its own.
        stays: Whether the ego never begins an overtake.
        delay: By how much later it begins the overtake; None for not at all [s].
        interventions: Other changes.
    """

    without: tuple[str, ...] = ()
    driving_style: str | None = None
    stays: bool = False
    delay: float | None = None
    interventions: tuple[Intervention, ...] = ()

    @property
    def title(self) -> str:
        """It in a few words."""
        parts = [f"without {one}" for one in self.without]
        parts += [f"{self.driving_style} driver"] if self.driving_style else []
        parts += ["staying in the lane"] if self.stays else []
        parts += [f"starting {self.delay:g} s later"] if self.delay is not None else []
        parts += [_words(one) for one in self.interventions]
        return ", ".join(parts) or "nothing changed"


def twin_of(
    scene: Scene, wish: Wish, *, start_time: float = 0.0, effect: str = Effect.DIRECT
) -> Twin:
    """A simulation and its twin.

    Args:
        scene: The simulation.
        wish: The changes.
        start_time: Time from which weather, driver and `stays` differ [s].
        effect: `direct` or `total`, see `Effect`.

    Raises:
        ConfigError: A name of weather, driving style or effect is unknown, the simulation ends
            before `start_time`, the ego begins no overtake that can be delayed, the changes both
            keep it in its lane and delay its overtake, or the total effect of the changes is not
            defined.
    """
    check_choice(effect, [*Effect], what="effect", where="twin")
    if wish.stays and wish.delay is not None:
        raise ConfigError(
            what="change",
            where="twin",
            expected="either an ego that stays in its lane or a later begin",
            got=f"both, with a delay of {wish.delay:g} s",
            next_step="leave one of them out",
        )
    is_total = effect == Effect.TOTAL
    is_drawn = not (wish.stays or wish.delay is not None or wish.interventions)
    if is_total and (start_time or not is_drawn):
        raise ConfigError(
            what="change",
            where="total effect",
            expected="weather or driver, from which other things are drawn",
            got="a change that nothing is drawn from, or a time",
            next_step="choose the direct effect, or change only weather or driving style",
        )
    frame = scene.frame_at(start_time)
    traits = scene.traits_of(wish.driving_style) if wish.driving_style else {}
    first = Intervention(frame=frame, without=wish.without, traits=traits)
    if is_total:
        run, redrawn = scene.redrawn(first), first
    else:
        run, redrawn = scene.branch(*_changes(scene, wish, first)), None
    made = run.branch_origin.interventions if run.branch_origin else ()
    told = (
        Told(title="as it was", run=scene.run),
        Told(title=wish.title, run=run, redrawn=redrawn),
    )
    return Twin(
        number=scene.number,
        title=wish.title,
        effect=Effect(effect),
        since=min((one.frame for one in made), default=0) / scene.rate,
        told=told,
        labelled=(label(scene.run), label(run)),
        parting=parting(scene.run, run),
        begins=(_seconds(scene, scene.run), _seconds(scene, run)),
        lamps=lamps_differ(scene.run, run),
    )


def _changes(scene: Scene, wish: Wish, first: Intervention) -> list[Intervention]:
    """What is different from which frame on."""
    changes = [*wish.interventions, *([first] if first.without or first.traits else [])]
    if wish.stays:
        changes.append(Intervention(frame=first.frame, decision=ForcedDecision.STAY))
    if wish.delay is not None:
        changes += later_start(scene, wish.delay, changes)
    return changes


def later_start(
    scene: Scene, delay: float, others: Iterable[Intervention] = ()
) -> tuple[Intervention, ...]:
    """Changes by which the ego pulls out later, without regard to the gaps then.

    How long it has to signal before depends on what it showed, so starts are tried. The one that
    comes nearest is taken, never before the wish; an indicator that fades in the meantime makes it
    a decision later at times.

    Args:
        scene: A simulation in which the ego pulls out.
        delay: By how much later, 0 to `MOST_DELAY` [s].
        others: What else is different.

    Raises:
        ConfigError: It never pulls out, or cannot that late.
    """
    if not 0.0 <= delay <= MOST_DELAY:
        raise ConfigError.out_of_range(
            what="delay", where="what if", low=0.0, high=MOST_DELAY, got=delay
        )
    was = scene.pull_out
    if was is None:
        raise _no_start("one that begins", "none")
    wanted = was + round(delay * scene.rate)
    if wanted == was:
        return ()
    found: dict[int, tuple[Intervention, ...]] = {}
    stay = Intervention(frame=was, decision=ForcedDecision.STAY)
    for frame in range(max(wanted - _STEADY, was + 1), wanted + 1):
        pair = (stay, Intervention(frame=frame, decision=ForcedDecision.PULL_OUT))
        began = pull_out(scene.branch(*others, *pair))
        if began is not None and began >= wanted:
            found.setdefault(began, pair)
    if not found:
        raise _no_start(f"one that can begin {delay:g} s later", "a simulation that has ended then")
    return found[min(found)]


def parting(before: Trajectories, after: Trajectories) -> Parting | None:
    """The first frame in which two batches of one simulation move differently; None if none."""
    interval = before.scenario.frame_interval_ms
    differs = _differences(before, after)
    del differs[_LAMPS]
    anyhow = np.any(list(differs.values()), axis=0)
    found = np.flatnonzero(anyhow.any(axis=0))
    if not len(found):
        return None
    frame = int(found[0])
    slot = int(np.flatnonzero(anyhow[:, frame])[0])
    name = next(name for name, where in differs.items() if where[slot, frame])
    values = [int(getattr(run.states, name)[0, slot, frame]) for run in (before, after)]
    own = np.flatnonzero(anyhow[EGO_SLOT])
    return Parting(
        frame=frame,
        time=frame * interval / 1000,
        vehicle=slot,
        quantity=name,
        by=(values[1] - values[0]) * STATE_RESOLUTION.get(name, 1.0),
        ego_time=int(own[0]) * interval / 1000 if len(own) else None,
    )


def _differences(before: Trajectories, after: Trajectories) -> dict[str, NDArray[np.bool_]]:
    """Where recorded numbers differ, by name, shape (vehicle, time); as far as both go."""
    frames = min(int(before.num_frames[0]), int(after.num_frames[0]))
    slots = min(before.scenario.num_slots, after.scenario.num_slots)
    one, two = before.states, after.states
    return {
        name: getattr(one, name)[0, :slots, :frames] != getattr(two, name)[0, :slots, :frames]
        for name in States.__slots__
    }


def _seconds(scene: Scene, run: Trajectories) -> float | None:
    """When the ego pulls out [s]."""
    frame = pull_out(run)
    return None if frame is None else frame / scene.rate


def lamps_differ(before: Trajectories, after: Trajectories) -> float | None:
    """First time at which lamps of two batches of one simulation differ; None if they never do."""
    found = np.flatnonzero(_differences(before, after)[_LAMPS].any(axis=0))
    return int(found[0]) * before.scenario.frame_interval_ms / 1000 if len(found) else None


def _words(change: Intervention) -> str:
    """Another change in a few words."""
    parts = [f"without {one}" for one in change.without]
    who = "ego" if change.slot == EGO_SLOT else f"vehicle {change.slot}"
    parts += [f"{who} with {name} {value:g}" for name, value in change.traits.items()]
    parts += [f"{who} {change.position_change:+g} m"] if change.position_change else []
    parts += [f"{who} {change.speed_change:+g} m/s"] if change.speed_change else []
    parts += [f"without {who}"] if change.remove else []
    parts += [change.decision.name.lower().replace("_", " ")] if change.decision else []
    return ", ".join(parts)


def _no_start(expected: str, got: str) -> ConfigError:
    return ConfigError(
        what="overtake",
        where="delay of a start",
        expected=expected,
        got=got,
        next_step="choose a simulation in which the ego overtakes, or a shorter delay",
    )
