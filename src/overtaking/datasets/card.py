"""The data card: what lies in the folder of a data set, for whoever finds it."""

import pyarrow as pa

from overtaking.datasets.manifest import BalanceRecord, Identity, ShardRecord
from overtaking.tables.columns import STEPS, flags_of, names_of, unit_of
from overtaking.tables.schemas import KEYS, SCHEMAS

FILE_NAME = "README.md"

_HEAD = """\
# {simulations} simulated overtaking scenes: {profile}

Made by the Python package `overtaking`; no recording of real traffic is part of it. Run beside
this file, the following makes the same values again on any machine:

    import overtaking
    made = overtaking.load(".").manifest.identity
    overtaking.generate(
        made.spec, made.simulations, made.seed, "again", road=made.road, keep=made.keep{again}
    )

| | |
|---|---|
| profile | {profile} |
| specification | SHA-256 `{spec_hash}`, in full in `dataset.json` |
| road | {road}, {lanes} lanes, {length:g} m |
| seed | {seed} |
| simulations | {simulations} |
| simulator | {simulator}, model version {simulator_version} |
| version of the tables | {table_version} |
| content hash | `{content_hash}` |

"""

_IMPORTED = """\
# {simulations} scenes of recorded traffic: {source[recording]}

Made by the Python package `overtaking` from a recording in the format {profile}; who may use or
pass on the recording, its owners say. `dataset.json` has what was found in it and what was
measured. What the recording does not tell is null: {unknown_names}.

| | |
|---|---|
| recording | {source[recording]} |
{files}
| road | {road}, {lanes} lanes, {length:g} m, straightened |
| scenes | {simulations} |
| version of the tables | {table_version} |
| content hash | `{content_hash}` |

"""

_BALANCED = """\
## Balanced

Asked for: {balance}. Of {candidates} candidates, the first ones of each cell were kept, up to the
number that was wanted. {outside} candidates were of a class that is not wanted, and {missing}
simulations are missing because their cell is too rare. `class_weight` in `labels` gives back the
shares that the cells had among the candidates; it is the weight below times that of the sampling.

| cell | wanted | candidates | kept | weight |
|---|---|---|---|---|
{cells}

"""

_AGAIN = ",\n        balance=made.balance,"

_READING = """\
## Reading it

Every folder below is a table, in Parquet files that any reader takes as one:

    import overtaking
    data = overtaking.load(".")          # pandas, SI units: data.states(17), data.vehicles(), ...

    select * from 'states/*.parquet' join 'simulations/*.parquet' using (simulation)   -- DuckDB

Integer columns count steps; the step is in the name. Null means that there is nothing to state.
Vehicle 0 is the ego, the vehicle whose overtaking is studied. `d` and angles grow to the left, `x`
and `y` are those of the OpenDRIVE road, right-handed, and positions are those of the centres of the
bounding boxes. `dataset.json` holds the checksum of every file.
"""

_TABLE = """
## {name}: {rows} rows

One row for each {keys}.

| column | type | unit | meaning |
|---|---|---|---|
"""


def data_card(
    identity: Identity,
    shards: tuple[ShardRecord, ...],
    content_hash: str,
    balance: BalanceRecord | None = None,
) -> str:
    """The text of a data set's `README.md`.

    Args:
        identity: What decides the content.
        shards: All shards.
        content_hash: Hash over the values of all tables.
        balance: What became of the cells of a balanced data set.
    """
    given = identity.model_dump(exclude={"spec", "road", "simulations"})
    road = identity.road
    head = _IMPORTED if identity.source else _HEAD
    head = head.format(
        **given,
        simulations=sum(shard.simulations for shard in shards),
        again=_AGAIN if balance else "",
        road=road.name,
        lanes=road.num_lanes,
        length=road.length,
        content_hash=content_hash,
        unknown_names=", ".join(identity.unknown) or "nothing",
        files=_files(identity),
    )
    return (
        head
        + (_balanced(identity, balance) if balance else "")
        + _READING
        + "".join(_table(name, shards) for name in SCHEMAS if name in identity.keep.tables)
    )


def _files(identity: Identity) -> str:
    """The files of a recording, one to a row."""
    files = identity.source.files if identity.source else {}
    return "\n".join(f"| file | {name}, SHA-256 `{digest}` |" for name, digest in files.items())


def _balanced(identity: Identity, balance: BalanceRecord) -> str:
    """The chapter about the cells."""
    cells = "\n".join(
        f"| {name} | {cell.quota} | {cell.seen} | {cell.kept} | {cell.weight:.6g} |"
        for name, cell in balance.cells.items()
    )
    return _BALANCED.format(
        **balance.model_dump(exclude={"cells"}), cells=cells, balance=identity.balance
    )


def _table(name: str, shards: tuple[ShardRecord, ...]) -> str:
    """The chapter of one table."""
    rows = sum(shard.tables[name].rows for shard in shards)
    keys = ", ".join(f"`{key}`" for key in KEYS[name])
    return _TABLE.format(name=name, rows=rows, keys=keys) + "".join(map(_row, SCHEMAS[name]))


def _row(field: pa.Field) -> str:
    """The row about one column."""
    unit = unit_of(field)
    step = f"{unit} = 1/{STEPS[unit][1]} {STEPS[unit][0]}" if unit in STEPS else unit
    meaning = field.metadata[b"description"].decode()
    kind = str(field.type)
    if names := names_of(field):
        kind, meaning = "name", f"{meaning}: {', '.join(names)}"
    if flags := flags_of(field):
        bits = ", ".join(f"{1 << place} {name}" for place, name in enumerate(flags))
        meaning = f"{meaning}: {bits}"
    if field.nullable:
        meaning += "; may be null"
    return f"| `{field.name}` | {kind} | {'' if unit == '1' else step} | {meaning} |\n"
