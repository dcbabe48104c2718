"""Outcomes of an overtake that begins at each instant: many futures of one simulation."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.result_methods import Plottable
from overtaking.analysis.stats.weighted_statistics import wilson_interval
from overtaking.analysis.whatif.beliefs import Percept, proposals
from overtaking.analysis.whatif.futures import copies, started
from overtaking.analysis.whatif.scenes import Scene, pull_out
from overtaking.core.arrays import I64
from overtaking.core.equality import ContentEquality
from overtaking.core.errors import check_choice
from overtaking.labels.labelling import label
from overtaking.labels.law.judging import choose_policy
from overtaking.labels.law.judging import stored_policy as policy_named
from overtaking.model.scenario import ForcedDecision
from overtaking.model.trajectories import Stage, Trajectories
from overtaking.model.verdicts import OvertakeClass
from overtaking.sim.branching import branch

CONDITIONS = ("truth", "belief")
"""What the futures share: the others as they are, or what the ego believes of them."""

TOO_FEW = 20
"""With fewer futures no share is told."""

_TRIES = 6
"""Worlds that are proposed for each that is to agree with the percepts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fan(ContentEquality, Plottable):
    """The futures of one simulation.

    Attributes:
        number: Its number in its data set.
        condition_on: A name in `CONDITIONS`.
        policy: The policy that decides about the classes.
        asked: Futures that were asked for at each instant.
        time: When the ego has to begin, while it is sound in its lane, shape (instant,) [s].
        begun: When it pulls out then, NaN where it cannot, shape (instant,) [s].
        counts: Futures of each class, shape (instant, `OvertakeClass`).
        tried: Worlds that were proposed, shape (instant,).
        actual: When it pulled out as it was; None if it never did [s].
        stayed: The simulation in which it never begins: the scene of the instants.
    """

    number: int
    condition_on: str
    policy: str
    asked: int
    time: NDArray[np.float64]
    begun: NDArray[np.float64]
    counts: I64
    tried: I64
    actual: float | None
    stayed: Trajectories

    @property
    def futures(self) -> I64:
        """Futures at each instant, shape (instant,)."""
        return self.counts.sum(axis=1)

    @property
    def is_enough(self) -> NDArray[np.bool_]:
        """Where there are as many as `TOO_FEW`, shape (instant,)."""
        return self.futures >= TOO_FEW

    @property
    def shares(self) -> NDArray[np.float64]:
        """Share of each class, NaN where there are too few, (instant, `OvertakeClass`)."""
        whole = np.where(self.is_enough, self.futures, np.nan)
        return self.counts / whole[:, None]

    def interval(self, code: OvertakeClass) -> NDArray[np.float64]:
        """Wilson's 95 % interval of the share of a class, NaN with too few, (instant, 2)."""
        rows = zip(self.shares[:, code], self.futures, strict=True)
        limits = np.array([wilson_interval(share, size) for share, size in rows])
        return np.where(self.is_enough[:, None], limits, np.nan)


def fan_of(
    scene: Scene,
    *,
    condition_on: str = "truth",
    futures: int = 25,
    every: float = 0.5,
    policy: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Fan:
    """Outcomes of an overtake that begins at each instant.

    Until the instant the ego stays in its lane. Then it begins as soon as it has signalled,
    whatever the gaps, and decides alone from there on. The changes of a branch are made at their
    frames, before and after the instant; decisions that it forces on the ego are left out.

    Args:
        scene: The simulation.
        condition_on: `truth`: all are as they are, and only what is drawn at later decisions
            differs, such as gusts and errors of judgement. The first future has the simulation's
            own numbers.
            `belief`: also other people, other places of vehicles that the ego has not noticed, and
            other errors of the ego; kept are worlds in which it notices the same when it begins.
        futures: At each instant.
        every: Time between two instants, a multiple of that between frames [s].
        policy: Which rules decide about the class; None for the default of the profile.
        progress: Called with the number of instants that are done, and of all.

    Raises:
        ConfigError: There is no such policy.
    """
    check_choice(condition_on, CONDITIONS, what="condition_on", where="fan")
    policy = choose_policy(policy, scene.scenario.profile)
    policy_named(policy)
    stayed = branch(
        scene.scenario, decision=ForcedDecision.STAY, interventions=scene.world.interventions
    )
    step = max(round(every * scene.rate), 1)
    frames = np.arange(0, _sound_frames(stayed), step)
    counts = np.zeros((len(frames), len(OvertakeClass)), np.int64)
    begun, tried = np.full(len(frames), np.nan), np.zeros(len(frames), np.int64)
    for place, frame in enumerate(frames.tolist()):
        run, tried[place] = _futures(scene, stayed, frame, condition_on, futures)
        if run is not None:
            labels = label(run).labels
            codes = labels.classes[:, labels.policies.index(policy)]
            counts[place] = np.bincount(codes, minlength=len(OvertakeClass))
            first = pull_out(run)
            begun[place] = np.nan if first is None else first / scene.rate
        if progress is not None:
            progress(place + 1, len(frames))
    actual = scene.pull_out
    return Fan(
        number=scene.number,
        condition_on=condition_on,
        policy=policy,
        asked=futures,
        time=frames / scene.rate,
        begun=begun,
        counts=counts,
        tried=tried,
        actual=None if actual is None else actual / scene.rate,
        stayed=stayed,
    )


def _sound_frames(stayed: Trajectories) -> int:
    """Frames before the ego collides in its lane; all if it does not."""
    crashed = np.flatnonzero(stayed.stage[0, : stayed.num_frames[0]] == Stage.CRASHED)
    return int(crashed[0]) if len(crashed) else int(stayed.num_frames[0])


def _futures(
    scene: Scene, stayed: Trajectories, frame: int, condition_on: str, count: int
) -> tuple[Trajectories | None, int]:
    """The futures of a start at a frame, None if there are none; and how many were tried."""
    world = scene.world
    if condition_on == "truth":
        return started(world, frame, copies(world, frame, count)), count
    percept = Percept.of(started(world, frame, copies(world, frame, 1)))
    if percept is None:
        return None, 0
    tried = _TRIES * count
    many = proposals(scene, stayed, frame, percept, tried)
    run = started(world, frame, many)
    kept = np.flatnonzero(percept.is_shared_by(run))[:count]
    return (run.select(kept) if len(kept) else None), tried
