"""`dataset.json`: the recipe of a data set, how far it got, and what its files hold."""

import codecs
import dataclasses
import hashlib
import json
import platform
import shlex
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    JsonValue,
    SerializerFunctionWrapHandler,
    ValidationError,
    field_serializer,
    model_serializer,
    model_validator,
)

from overtaking.core.errors import DatasetError, SchemaError
from overtaking.core.files import read_bounded
from overtaking.data import plan
from overtaking.data.balance import ClassBalance
from overtaking.data.location import Location
from overtaking.data.recipe import Keep, PolicyRecord, Recipe, Simulator, tables_of
from overtaking.data.tables.files import FileFacts
from overtaking.data.tables.schemas import VERSION as TABLE_VERSION
from overtaking.labels.law.judging import choose_policy
from overtaking.model.road import Road
from overtaking.model.weather import LateralPushes
from overtaking.scenarios.profiles import load_specification as checked_spec
from overtaking.scenarios.profiles import profile_names

FILE_NAME = "dataset.json"
FORMAT = "overtaking.dataset"

VERSION = 1
"""Version of the manifest itself; the tables have versions of their own."""


_MOST_BYTES = 1 << 26
_MOST_VALUES = 2_000_000
"""Twice what `MAX_SHARDS` shards take. A file of commas would take thirty times its size."""

_Hash = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
_Number = Annotated[int, Field(ge=0, le=plan.MAX_SIMULATIONS)]
_Count = Annotated[int, Field(ge=1, le=plan.MAX_SIMULATIONS)]


def _sampled(spec: dict[str, JsonValue]) -> dict[str, JsonValue]:
    """Refuse a wrong specification; recordings have an empty one."""
    if spec:
        checked_spec(spec)
    return spec


class _Record(BaseModel):
    """Base of all parts: frozen, without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class ShardRecord(_Record):
    """One finished shard.

    Attributes:
        number: Number of the shard.
        first: Number of its first simulation.
        simulations: Number of simulations.
        tables: Its file of each table.
        clipped: Answers of a policy that were beyond the limits; null, and not written, without a
            policy.
    """

    number: _Number
    first: _Number
    simulations: _Count
    tables: dict[str, FileFacts]
    clipped: Annotated[int, Field(ge=0)] | None = None

    @model_serializer(mode="wrap")
    def _without_what_is_unknown(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """The record as it was before there were policies."""
        said = dump(self)
        if self.clipped is None:
            del said["clipped"]
        return said


class Source(_Record):
    """The origin of an imported data set.

    Attributes:
        format: Format of the recording.
        files: SHA-256 of each file that was read, by its name.
        recording: What the recording calls itself.
        options: The options of the call.
        counts: Counts of its vehicles, overtakes and simulations.
        notes: What the reader decided, left out or measured.
    """

    format: str
    files: dict[str, _Hash]
    recording: str
    options: dict[str, JsonValue] = Field(default_factory=dict)
    counts: dict[str, JsonValue] = Field(default_factory=dict)
    notes: dict[str, JsonValue] = Field(default_factory=dict)


class BranchRecord(_Record):
    """A simulation with something changed.

    Attributes:
        title: What it is, in a few words.
        index: Number of the scenario among all that the specification and the seed give.
        redrawn: The change before anything was drawn that depends on it; null if there was none.
        interventions: Those in the drawn scenario, as `model.scenario.Intervention.to_dict` writes
            them.
    """

    title: str
    index: Annotated[int, Field(ge=0, lt=2**64)]
    redrawn: dict[str, JsonValue] | None = None
    interventions: tuple[dict[str, JsonValue], ...] = ()


class CellRecord(_Record):
    """The result of the search for one cell of a balanced data set.

    Attributes:
        quota: Simulations that were wanted.
        seen: Candidates that were of it.
        kept: Candidates that were kept.
        weight: Factor of the weight of each of them; 0 if there are none.
    """

    quota: _Number
    seen: _Number
    kept: _Number
    weight: Annotated[float, Field(ge=0.0)]


class BalanceRecord(_Record):
    """The result of the search for a balanced data set.

    Attributes:
        candidates: Candidates that were looked at.
        outside: Those among them whose class has no quota.
        missing: Simulations that are missing in all cells together.
        cells: What became of each cell, by its name.
    """

    candidates: _Number
    outside: _Number
    missing: _Number
    cells: dict[str, CellRecord]


class Identity(_Record):
    """Everything that decides the content: data sets with equal identities have equal values.

    Attributes:
        profile: Name of the profile.
        spec: The specification, resolved.
        spec_hash: Hash over it.
        road: The road.
        seed: Seed of the random numbers; null for recordings.
        simulations: Number of simulations that were asked for.
        shard_size: Simulations a shard.
        keep: Tables that were kept.
        table_version: Version of the tables' schemas.
        simulator: Name of the simulator.
        simulator_version: Version of the model that it computes.
        unknown: What the simulations do not tell, names of `model.trajectories.UNKNOWNS`.
        source: The recording that it was imported from; null for simulations.
        balance: How it is balanced; null if it is not.
        policy: Another driver of the egos; null if the model drove them.
        branches: What was changed in each simulation; empty where none is a branch.
    """

    profile: str
    spec: Annotated[dict[str, JsonValue], AfterValidator(_sampled)]
    spec_hash: str
    road: Road
    seed: Annotated[int, Field(ge=0, lt=2**64)] | None
    simulations: _Count
    shard_size: _Count
    keep: Keep
    table_version: _Count
    simulator: str
    simulator_version: str
    unknown: tuple[str, ...] = ()
    source: Source | None = None
    balance: ClassBalance | None = None
    policy: PolicyRecord | None = None
    branches: tuple[BranchRecord, ...] = ()

    @field_serializer("road", mode="wrap")
    def _road_values(self, road: Road, dump: SerializerFunctionWrapHandler) -> Any:
        """Values of the road, without zero origins and empty parts of the course.

        A field that is added to `Road` later must not change the fingerprint of a road without it.
        """
        values = dump(road)
        for name in ("origin_x", "origin_y"):
            if not getattr(road, name):
                del values[name]
        if road.course is None:
            del values["course"]
        else:
            for name in ("segments", "grade", "speed_limit_spans"):
                if not getattr(road.course, name):
                    del values["course"][name]
        return values

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of its tables."""
        return tables_of(self.keep, self.policy)

    @classmethod
    def of(cls, recipe: Recipe, simulator: Simulator) -> "Identity":
        """The identity of the data set that a recipe and a simulator give."""
        return cls(
            profile=recipe.spec.name,
            spec=recipe.spec.to_dict(),
            spec_hash=recipe.spec.specification_hash,
            road=recipe.road,
            seed=recipe.seed,
            simulations=recipe.num_simulations,
            shard_size=recipe.shard_size,
            keep=recipe.keep,
            table_version=TABLE_VERSION,
            simulator=simulator.name,
            simulator_version=simulator.version,
            unknown=tuple(sorted(simulator.unknown)),
            balance=_with_limit(recipe),
            policy=recipe.policy,
        )

    def differences(self, other: "Identity") -> list[str]:
        """The names of the fields that differ, the most informative first."""
        names = [name for name in type(self).model_fields if name not in ("spec", "spec_hash")]
        different = [name for name in names if getattr(self, name) != getattr(other, name)]
        return [*different, *(["spec"] if self.spec_hash != other.spec_hash else [])]

    @property
    def pushes(self) -> LateralPushes | None:
        """How weather acts instead of by physics; None for physics, and for recordings."""
        found = checked_spec(self.spec).weather.pushes if self.spec else None
        return found and found.lateral_pushes

    @property
    def fingerprint(self) -> str:
        """SHA-256 over all of it, 64 hexadecimal digits."""
        values = self.model_dump(mode="json")
        # What is newer than version 1 counts where it says something: older ones stay as they are.
        values = {name: one for name, one in values.items() if name not in _NEW or one}
        text = json.dumps(values, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()


_NEW = frozenset({"unknown", "source", "balance", "policy", "branches"})


def _with_limit(recipe: Recipe) -> ClassBalance | None:
    """The balance of a recipe with its policy and its number of candidates filled in."""
    if recipe.balance is None:
        return None
    limit = recipe.balance.limit(recipe.num_simulations)
    policy = choose_policy(recipe.balance.policy, recipe.spec.name)
    return dataclasses.replace(recipe.balance, candidates=limit, policy=policy)


class ReportRecord(_Record):
    """The import report of a data set, `import_report.json`.

    Attributes:
        rows: Number of findings.
        sha256: Hash over the bytes of the file.
    """

    rows: Annotated[int, Field(ge=0)]
    sha256: _Hash


class Provenance(_Record):
    """Time, machine and software of a run; part of no hash.

    Attributes:
        started: When it was begun, UTC.
        finished: When it was completed, UTC.
        package: Version of this package.
        packages: Versions of the packages that decide the bytes of the files.
        python: Version of Python.
        machine: System and processor.
        details: What the simulator says of itself on that machine.
    """

    started: str
    finished: str | None = None
    package: str
    packages: dict[str, str]
    python: str
    machine: str
    details: dict[str, str] = Field(default_factory=dict)

    @classmethod
    def of_this_run(cls, details: Mapping[str, str]) -> "Provenance":
        """The provenance of this process, which begins now.

        Args:
            details: What the simulator says of itself.
        """
        return cls(
            started=now(),
            package=metadata.version("overtaking"),
            packages={name: metadata.version(name) for name in ("numpy", "pyarrow")},
            python=platform.python_version(),
            machine=f"{platform.system()} {platform.machine()}",
            details=dict(details),
        )


def now() -> str:
    """The time of the clock, UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


class Manifest(_Record):
    """The whole file.

    Attributes:
        format: Kind of file.
        version: Version of the manifest's form.
        complete: Whether every shard is there.
        content_hash: Hash over the values of all tables; null until complete.
        identity: What decides the content.
        shards: The finished shards; empty until complete.
        balance: What became of the cells; null until complete, and if there are none.
        import_report: The report of a recording; null for simulations. It is no part of the
            content hash.
        provenance: Where and when.
    """

    format: Literal["overtaking.dataset"] = FORMAT
    version: int = VERSION
    complete: bool = False
    content_hash: _Hash | None = None
    identity: Identity
    shards: Annotated[tuple[ShardRecord, ...], Field(max_length=plan.MAX_SHARDS)] = ()
    balance: BalanceRecord | None = None
    import_report: ReportRecord | None = None
    provenance: Provenance

    @model_validator(mode="after")
    def _shards_follow_each_other(self) -> Self:
        """Refuse shards that are not those of their number of simulations."""
        total, size = self.num_simulations, self.identity.shard_size
        known = [(one.number, one.first, one.first + one.simulations) for one in self.shards]
        if len(known) != plan.num_shards(total, size) or known != [
            (one.number, one.first, one.stop) for one in plan.shards(total, size)
        ]:
            raise ValueError("shards that do not follow each other")
        if self.complete and not (self.shards and self.content_hash):
            raise ValueError("complete, but without shards or hash")
        return self

    @property
    def num_simulations(self) -> int:
        """Simulations that are there; fewer than asked for where cells are short of some."""
        return sum(shard.simulations for shard in self.shards)

    @property
    def clipped(self) -> int:
        """Answers of a policy that were beyond the limits, in all shards."""
        return sum(shard.clipped or 0 for shard in self.shards)

    @property
    def how_to_simulate(self) -> str:
        """What to install to simulate as this data set was simulated, for a message."""
        identity = self.identity
        model = f"{identity.simulator} {identity.simulator_version}"
        return f"install overtaking {self.provenance.package} with {model}, which made it"


def content_hash(shards: tuple[ShardRecord, ...]) -> str:
    """Hash over the values of all tables, trace hashes among them, 64 hexadecimal digits."""
    total = hashlib.sha256()
    for shard in shards:
        for name in sorted(shard.tables):
            table = shard.tables[name]
            total.update(f"{shard.number} {name} {table.rows} {table.content}\n".encode())
    return total.hexdigest()


def write_manifest(location: Location, manifest: Manifest, *, is_first: bool = False) -> None:
    """Put a manifest into its place, whole or not at all.

    Args:
        location: Where the data set lies.
        manifest: What to write.
        is_first: Whether there must be none yet.

    Raises:
        FileExistsError: Another writer of the same store was first.
        OSError: It cannot be written.
    """
    text = manifest.model_dump_json(indent=2) + "\n"
    location.put_text(FILE_NAME, text, is_first=is_first)


def read_manifest(location: Location) -> Manifest:
    """The manifest of a data set.

    Args:
        location: Where it lies.

    Raises:
        DatasetError: There is none, or it cannot be read.
        SchemaError: It is of a newer version.
    """
    path = location.at(FILE_NAME)
    try:
        with location.open(FILE_NAME) as file:
            # Editors on Windows add a byte order mark, which JSON does not allow.
            data = read_bounded(file, _MOST_BYTES).removeprefix(codecs.BOM_UTF8)
    except OSError as error:
        if location.has(FILE_NAME):
            got = error.strerror or str(error)
            raise _unreadable(path, got, "check the path of the data set") from None
        raise _no_manifest(location, error) from None
    if sum(map(data.count, (b",", b"[", b"{"))) > _MOST_VALUES:
        raise _unreadable(path, f"more than {_MOST_VALUES} values", "restore it from a copy")
    try:
        _check_version(path, _Head.model_validate_json(data))
        return Manifest.model_validate_json(data, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = "".join(f"{part}: " for part in [".".join(map(str, first["loc"]))] if part)
        said = first["msg"].removeprefix("Value error, ")
        raise _unreadable(path, f"{key}{said}", "restore it from a copy") from None


def _no_manifest(location: Location, error: OSError) -> DatasetError:
    """The error for a location without a data set.

    Users often name a profile or its file instead; then the next step generates a data set from it.
    """
    where = str(location)
    path = Path(where)
    if where in profile_names() or (path.suffix == ".toml" and path.is_file()):
        command = ["overtaking", "generate", where, "--out", f"data/{path.stem}"]
        got, next_step = "a profile", f"make a data set from it: {shlex.join(command)}"
    elif path.is_dir() and not (path / FILE_NAME).exists():
        got, next_step = f"a folder without {FILE_NAME}", "check the path of the data set"
    else:
        got = "a file" if path.is_file() else error.strerror or str(error)
        next_step = "check the path of the data set"
    return DatasetError(
        what="data set",
        where=where,
        expected=f"its folder, which holds {FILE_NAME}",
        got=got,
        next_step=next_step,
    )


class _Head(BaseModel):
    """Format and version, which are checked first."""

    model_config = ConfigDict(strict=True)

    format: JsonValue = None
    version: JsonValue = None


def _check_version(path: str, head: _Head) -> None:
    """Refuse a file that is no manifest, or a manifest of a newer version."""
    version = head.version
    if head.format != FORMAT or not isinstance(version, int) or isinstance(version, bool):
        raise _unreadable(path, "another kind of file", "check the path of the data set")
    if version > VERSION:
        raise SchemaError.newer_version(
            what="version of the manifest", where=path, newest=VERSION, got=version
        )


def _unreadable(path: str, got: str, next_step: str) -> DatasetError:
    return DatasetError(
        what="manifest", where=path, expected="that of a data set", got=got, next_step=next_step
    )
