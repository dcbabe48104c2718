"""The recipe of a data set, and the simulator that carries it out."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from overtaking.data.balance import ClassBalance
from overtaking.data.plan import CHUNK_SIZE, SHARD_SIZE
from overtaking.data.tables.schemas import LABEL_TABLES
from overtaking.model.driver_interface import Actions
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.scenarios.specification import Specification


class Keep(StrEnum):
    """Which tables are written."""

    FRAMES = "frames"
    FEATURES = "features"

    @property
    def tables(self) -> tuple[str, ...]:
        """The tables that are written; `simulations` is always the last."""
        whole = ("weather", "vehicles", "percepts", *LABEL_TABLES)
        per_frame = ("frames", "states") if self is Keep.FRAMES else ()
        return (*whole, *per_frame, "simulations")


@dataclass(frozen=True, slots=True, kw_only=True)
class PolicyRecord:
    """Another driver of the ego, as a manifest names it.

    Attributes:
        name: Its name.
        version: Its version, empty if it has none.
        digest: SHA-256 of the file it comes from, or what it says itself; empty if unknown.
        observe: What it observes: `human`, `truth`, or the numbers of a sensor.
        action: What it answers.
        hold: Decisions for which an answer holds.
    """

    name: str
    version: str
    digest: str
    observe: str | dict[str, float]
    action: str
    hold: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulator:
    """A function that simulates, and what identifies its results.

    Attributes:
        name: Name of the simulator.
        version: Changes whenever a simulated number changes.
        simulate: Scenarios in, recorded simulations out, in the same order.
        details: Facts of the machine that change no number, such as the SIMD level.
        unknown: What it cannot tell of a simulation, names of `model.trajectories.UNKNOWNS`.
        chunk_size: Simulations that it is given at a time; few where each of them takes long.
        shard_size: Simulations a file, and at most that many to do again after an interruption.
        threads: How many threads may simulate at a time; one where it has a world of its own.
        shares_world: Whether all processes share one world, such as a server, so that only one of
            them may simulate at a time.
        replay: Simulates scenarios in which another driver did something; None if it cannot.
    """

    name: str
    version: str
    simulate: Callable[[Scenario], Trajectories]
    details: Mapping[str, str] = field(default_factory=dict[str, str])
    unknown: frozenset[str] = frozenset()
    chunk_size: int = CHUNK_SIZE
    shard_size: int = SHARD_SIZE
    threads: int = 1
    shares_world: bool = False
    replay: Callable[[Scenario, Actions], Trajectories] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """Everything that decides the values of a data set.

    Attributes:
        spec: What to sample.
        road: Where.
        seed: Seed of the random numbers, 0 <= seed < 2**64.
        num_simulations: How many.
        keep: What to write down of each.
        shard_size: Simulations a shard.
        balance: How the cells are filled; None for every simulation as it comes.
        policy: Another driver of the egos; None for the model's.
    """

    spec: Specification
    road: Road
    seed: int
    num_simulations: int
    keep: Keep
    shard_size: int
    balance: ClassBalance | None = None
    policy: PolicyRecord | None = None

    @property
    def tables(self) -> tuple[str, ...]:
        """The tables that are written; `simulations` is always the last."""
        return tables_of(self.keep, self.policy)


def tables_of(keep: Keep, policy: PolicyRecord | None) -> tuple[str, ...]:
    """The tables of a data set; what another driver did is always kept."""
    return keep.tables if policy is None else ("actions", *keep.tables)
