"""Simulations of a data set, as the subjects of what-if questions."""

from dataclasses import dataclass, replace

import numpy as np

from overtaking.core.errors import ConfigError
from overtaking.data.branches import branch_again, drawn
from overtaking.data.load import Dataset
from overtaking.labels.labelling import LabelledTrajectories
from overtaking.model.scenario import BranchOrigin, Intervention, Scenario
from overtaking.model.trajectories import Stage, Trajectories
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import OvertakeClass
from overtaking.sim.branching import branch

SIMULATED_BY = ("engine", "reference")
"""The simulators whose simulations can go on in another way."""

DRIVING_STYLES = {"careful": 0.0, "average": 0.5, "reckless": 1.0}
"""Driving styles by name, from 0 (careful) to 1 (reckless)."""

_MS_PER_S = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A simulation as it was.

    Attributes:
        data: Its data set.
        number: Its number there.
        run: The recording, a batch of one; a branch if the data set is one of branches.
    """

    data: Dataset
    number: int
    run: Trajectories

    @property
    def scenario(self) -> Scenario:
        """Its scenario, before any change."""
        branched = self.run.branch_origin
        return self.run.scenario if branched is None else branched.scenario

    @property
    def world(self) -> BranchOrigin:
        """Its scenario, and what is changed in it but the decisions of the ego."""
        branched = self.run.branch_origin or BranchOrigin(
            scenario=self.run.scenario, interventions=()
        )
        changes = (replace(one, decision=None) for one in branched.interventions)
        meant = tuple(one for one in changes if one != Intervention(frame=one.frame))
        return branched.replace(interventions=meant)

    @property
    def rate(self) -> float:
        """Frames a second."""
        return _MS_PER_S / self.run.scenario.frame_interval_ms

    @property
    def pull_out(self) -> int | None:
        """First frame in which the ego pulls out; None if it never does."""
        return pull_out(self.run)

    def frame_at(self, time: float) -> int:
        """The frame at a time [s].

        Raises:
            ConfigError: The simulation ends before.
        """
        frame, last = round(time * self.rate), int(self.run.num_frames[0]) - 1
        if not 0 <= frame <= last:
            raise ConfigError.out_of_range(
                what="time", where="what if", low=0.0, high=last / self.rate, got=time
            )
        return frame

    def branch(self, *changes: Intervention) -> Trajectories:
        """The simulation with something changed."""
        return branch(self.run, interventions=changes)

    def redrawn(self, change: Intervention) -> Trajectories:
        """The simulation drawn again from the same numbers, with something changed before.

        Raises:
            ConfigError: It is a branch already.
        """
        if self.run.branch_origin is not None:
            raise ConfigError(
                what="simulation",
                where="what if from the start",
                expected="one as it was drawn",
                got="a branch",
                next_step="change the simulation that it branches from",
            )
        return branch(drawn(self.data, int(self.scenario.scenario_index[0]), change))

    def traits_of(self, name: str) -> dict[str, float]:
        """The traits of the ego's driver, drawn from the same numbers with another driving style.

        Args:
            name: A name in `DRIVING_STYLES`.

        Raises:
            ConfigError: There is no such name.
        """
        if name not in DRIVING_STYLES:
            raise ConfigError.unknown_choice(
                what="driving_style", where="what if", choices=DRIVING_STYLES, got=name
            )
        style = {"drivers.driving_style": [DRIVING_STYLES[name]] * 2}
        theirs = drawn(self.data, int(self.scenario.scenario_index[0]), overrides=style).drivers
        rows = {field: getattr(theirs, field)[0, EGO_SLOT] for field in theirs.__slots__}
        return {field: one.item() for field, one in rows.items()}


def scene_of(data: Dataset, number: int) -> Scene:
    """A simulation of a data set.

    Args:
        data: The data set.
        number: Number of the simulation.

    Raises:
        ConfigError: A policy drives its egos, or another simulator made it.
        DatasetError: It is of recorded traffic, or damaged.
        NoSuchSimulationError: There is no such simulation.
    """
    identity = data.manifest.identity
    if identity.branches:
        return Scene(data=data, number=number, run=branch_again(data, number))
    if identity.policy is not None or identity.simulator not in SIMULATED_BY:
        by = identity.policy.name if identity.policy else identity.simulator
        raise ConfigError(
            what="data set",
            where=data.where,
            expected="simulations of this package's drivers",
            got=f"simulations of {by}",
            next_step="generate the same profile and seed with them",
        )
    return Scene(data=data, number=number, run=data.trajectory(number))


def pull_out(run: Trajectories) -> int | None:
    """First frame in which the ego of the first simulation pulls out; None if it never does."""
    found = np.flatnonzero(run.stage[0, : run.num_frames[0]] == Stage.PULL_OUT)
    return int(found[0]) if len(found) else None


def class_of(labelled: LabelledTrajectories, policy: str) -> str:
    """The class of the first simulation under a policy."""
    labels = labelled.labels
    return OvertakeClass(int(labels.classes[0, labels.policies.index(policy)])).title
