"""Data sets of branches: their manifest says of which simulation each is one, and what changed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from overtaking.core.equality import ContentEquality
from overtaking.core.errors import DatasetError
from overtaking.core.files import atomic_folder, check_folder_is_free
from overtaking.data import plan, shards
from overtaking.data.completion import complete
from overtaking.data.interruption import all_or_nothing
from overtaking.data.load import Dataset
from overtaking.data.location import Folder
from overtaking.data.manifest import BranchRecord, Identity, Manifest, Provenance
from overtaking.data.recipe import Keep
from overtaking.data.tables.encode_labels import contents
from overtaking.data.tables.schemas import VERSION as TABLE_VERSION
from overtaking.data.tables.schemas import schema_of
from overtaking.model.scenario import Intervention, Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import MODEL_VERSION
from overtaking.sim.branching import apply_intervention, branch

BY = "engine"
"""The simulator in the manifest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Told(ContentEquality):
    """A simulation to write down.

    Attributes:
        title: What it is, in a few words.
        run: A batch of one: a simulation as it is, or a branch.
        redrawn: What was different before anything was drawn that depends on it; None if nothing.
    """

    title: str
    run: Trajectories
    redrawn: Intervention | None = None

    @property
    def record(self) -> BranchRecord:
        """What the manifest says of it."""
        branched = self.run.branch_origin
        return BranchRecord(
            title=self.title,
            index=int(self.run.scenario.scenario_index[0]),
            redrawn=self.redrawn and self.redrawn.to_dict(),
            interventions=tuple(one.to_dict() for one in branched.interventions)
            if branched
            else (),
        )


def write_branches(of: Dataset, told: Sequence[Told], out: Path) -> None:
    """Write branches of simulations of a data set as a data set.

    Args:
        of: The data set.
        told: The simulations, one at least.
        out: Folder for it; it must not exist, or be empty.

    Raises:
        ConfigError: The folder holds something.
        DatasetError: It cannot be written; nothing is left behind.
    """
    check_folder_is_free(out)
    theirs = of.manifest.identity
    identity = Identity(
        profile=theirs.profile,
        spec=theirs.spec,
        spec_hash=theirs.spec_hash,
        road=told[0].run.road,
        seed=theirs.seed,
        simulations=len(told),
        shard_size=plan.SHARD_SIZE,
        keep=Keep.FRAMES,
        table_version=TABLE_VERSION,
        simulator=BY,
        simulator_version=MODEL_VERSION,
        branches=tuple(one.record for one in told),
    )
    tables = identity.tables
    next_step = "branch again; nothing was written"
    with all_or_nothing(out, "time to complete it", next_step), atomic_folder(out) as folder:
        location = Folder(folder)
        location.prepare(tables)
        begun = Manifest(identity=identity, provenance=Provenance.of_this_run({}))
        write = partial(shards.write_shard, location, fingerprint=identity.fingerprint)
        schemas = {name: schema_of(name) for name in tables}
        records = tuple(
            write(one, _pieces(told, one, tables), schemas=schemas, on_piece=lambda _: None)
            for one in plan.shards(len(told))
        )
        complete(location, begun, records)
        location.sweep()


def _pieces(
    told: Sequence[Told], shard: plan.Shard, tables: tuple[str, ...]
) -> Iterator[shards.Piece]:
    """The tables of a shard, simulation by simulation: their lengths and slots differ."""
    for number in range(shard.first, shard.stop):
        yield 1, contents(told[number].run, np.array([number], np.int64), tables)


def branch_again(data: Dataset, number: int) -> Trajectories:
    """A branch of a data set, simulated again from what its manifest says.

    Args:
        data: A data set of branches.
        number: Number of the simulation.

    Raises:
        DatasetError: It is no such data set, or the simulator has changed since.
    """
    found = _again(data, number)
    recorded = data.trajectory(number)
    if (found.trace_hash != recorded.trace_hash).any():
        raise DatasetError(
            what=f"simulation {number}, simulated again",
            where=data.where,
            expected="the recorded trace hash",
            got=f"another from {BY} {MODEL_VERSION}",
            next_step=data.manifest.how_to_simulate,
        )
    return found


def _again(data: Dataset, number: int) -> Trajectories:
    identity = data.manifest.identity
    if not identity.branches:
        raise DatasetError(
            what="data set",
            where=data.where,
            expected="one of branches",
            got="one of simulations as they are",
            next_step="take one that a branch was saved to",
        )
    record = identity.branches[number]
    redrawn = None if record.redrawn is None else Intervention.from_dict(record.redrawn)
    scenario = drawn(data, record.index, redrawn)
    return branch(scenario, interventions=map(Intervention.from_dict, record.interventions))


def drawn(
    data: Dataset,
    index: int,
    redrawn: Intervention | None = None,
    overrides: Mapping[str, Any] | None = None,
) -> Scenario:
    """A scenario of the profile, road and seed of a data set.

    Args:
        data: A data set of simulations.
        index: Its number among all that can be drawn.
        redrawn: What is different before speeds and distances are drawn; None if nothing.
        overrides: Dotted keys of the specification with other values.

    Raises:
        DatasetError: The data set is of recorded traffic.
    """
    identity = data.manifest.identity
    if identity.seed is None:
        raise DatasetError(
            what="data set",
            where=data.where,
            expected="simulations of this package",
            got=f"recordings in the format {identity.profile}",
            next_step="generate one; recorded traffic cannot answer a change",
        )
    change = None if redrawn is None else partial(apply_intervention, intervention=redrawn)
    numbers = np.array([index], np.uint64)
    return ScenarioSource(
        load_specification(identity.spec, overrides), identity.road, identity.seed
    ).sample(numbers, change)
