"""The data card: what lies in the folder of a data set, for whoever finds it.

`README.md` is for people and the Hugging Face Hub, `croissant.json` for other catalogues.
"""

import pyarrow as pa

from overtaking.data import croissant, datasheet
from overtaking.data.card_header import card_header
from overtaking.data.datasheet import num_rows, plain
from overtaking.data.manifest import (
    BalanceRecord,
    Identity,
    Manifest,
    ShardRecord,
    content_hash,
    now,
    write_manifest,
)
from overtaking.data.place import Place
from overtaking.data.tables.columns import names_of
from overtaking.data.tables.schemas import KEYS

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
# {simulations} scenes of recorded traffic: {recording}

Made by the Python package `overtaking` from a recording in the format {profile}; who may use or
pass on the recording, its owners say. `dataset.json` has what was found in it and what was
measured. What the recording does not tell is null: {unknown_names}.

| | |
|---|---|
| recording | {recording} |
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

    select * from '{largest}/*.parquet' join 'simulations/*.parquet' using (simulation)   -- DuckDB

In Polars it is `polars.read_parquet("{largest}/*.parquet")`, with the library of Hugging Face
`datasets.load_dataset(".", "{largest}")`, and `croissant.json` is for whatever reads Croissant.

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


def complete(
    place: Place,
    manifest: Manifest,
    shards: tuple[ShardRecord, ...],
    balance: BalanceRecord | None = None,
) -> None:
    """Write the data card, then the manifest, which makes the data set complete.

    Args:
        place: Where it lies.
        manifest: What the manifest says so far.
        shards: All shards.
        balance: What became of the cells of a balanced data set.

    Raises:
        OSError: They cannot be written.
    """
    content = content_hash(shards)
    write_cards(place, manifest.identity, shards, content, balance)
    if manifest.complete and manifest.shards == shards:
        return
    finished = manifest.provenance.finished or now()
    changes = {
        "complete": True,
        "content_hash": content,
        "shards": shards,
        "balance": balance,
        "provenance": manifest.provenance.model_copy(update={"finished": finished}),
    }
    write_manifest(place, manifest.model_copy(update=changes))


def write_cards(
    place: Place,
    identity: Identity,
    shards: tuple[ShardRecord, ...],
    content_hash: str,
    balance: BalanceRecord | None = None,
) -> None:
    """Put `README.md` and `croissant.json` beside the tables of a data set.

    Args:
        place: Where it lies.
        identity: What decides the content.
        shards: All shards.
        content_hash: Hash over the values of all tables.
        balance: What became of the cells of a balanced data set.

    Raises:
        OSError: They cannot be written.
    """
    card = data_card(identity, shards, content_hash, balance)
    given = _answers(identity, shards, balance)
    place.put_text(FILE_NAME, card)
    text = croissant.croissant(identity, shards, content_hash, given)
    place.put_text(croissant.FILE_NAME, text)


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
    given = identity.model_dump(exclude={"spec", "road", "simulations", "source"})
    road, simulations = identity.road, sum(shard.simulations for shard in shards)
    schemas = croissant.schemas_of(identity, shards)
    head = _IMPORTED if identity.source else _HEAD
    head = head.format(
        **given,
        simulations=simulations,
        recording=plain(identity.source.recording) if identity.source else "",
        again=_AGAIN if balance else "",
        road=plain(road.name),
        lanes=road.num_lanes,
        length=road.length,
        content_hash=content_hash,
        unknown_names=", ".join(identity.unknown) or "nothing",
        files=_files(identity),
    )
    return (
        card_header(identity, (name for name in schemas if num_rows(name, shards)), simulations)
        + head
        + (_balanced(identity, balance) if balance else "")
        + _READING.format(largest="states" if "states" in schemas else "vehicles")
        + datasheet.datasheet(_answers(identity, shards, balance))
        + "".join(_table(name, schema, shards) for name, schema in schemas.items())
    )


def _answers(
    identity: Identity, shards: tuple[ShardRecord, ...], balance: BalanceRecord | None
) -> datasheet.Answers:
    """The answers of the datasheet."""
    return datasheet.answers(identity, shards, balance.candidates if balance else None)


def _files(identity: Identity) -> str:
    """The files of a recording, one to a row."""
    files = identity.source.files if identity.source else {}
    return "\n".join(
        f"| file | {plain(name)}, SHA-256 `{digest}` |" for name, digest in files.items()
    )


def _balanced(identity: Identity, balance: BalanceRecord) -> str:
    """The chapter about the cells."""
    cells = "\n".join(
        f"| {name} | {cell.quota} | {cell.seen} | {cell.kept} | {cell.weight:.6g} |"
        for name, cell in balance.cells.items()
    )
    return _BALANCED.format(
        **balance.model_dump(exclude={"cells"}), cells=cells, balance=identity.balance
    )


def _table(name: str, schema: pa.Schema, shards: tuple[ShardRecord, ...]) -> str:
    """The chapter of one table."""
    keys = ", ".join(f"`{key}`" for key in KEYS[name])
    head = _TABLE.format(name=name, rows=num_rows(name, shards), keys=keys)
    return head + "".join(map(_row, schema))


def _row(field: pa.Field) -> str:
    """The row about one column."""
    kind = "name" if names_of(field) else str(field.type)
    unit, meaning = croissant.unit_text(field), croissant.meaning_of(field)
    return f"| `{field.name}` | {kind} | {unit} | {meaning} |\n"
