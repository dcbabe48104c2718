"""`croissant.json`: what catalogues and loaders of machine learning read about a data set.

Format: MLCommons Croissant 1.0 with the vocabulary RAI 1.0, which is JSON-LD, see
https://docs.mlcommons.org/croissant/docs/croissant-spec.html. Licence, address, creators and date
of publication are the publisher's to add: nothing here can know them.
"""

import json
import re
from collections.abc import Mapping
from typing import Any

import pyarrow as pa

from overtaking.data.card import Card, meaning_of, texts, unit_text
from overtaking.data.manifest import ShardRecord
from overtaking.data.plan import Shard
from overtaking.data.tables.schemas import KEYS

CROISSANT_NAME = "croissant.json"

Json = dict[str, Any]

CONFORMS_TO = ("http://mlcommons.org/croissant/1.0", "http://mlcommons.org/croissant/RAI/1.0")

_PARQUET = "application/x-parquet"

_CLASS = ("labels", "class")
"""The column that most readers will want to predict."""


def croissant(card: Card) -> str:
    """The text of a data set's `croissant.json`."""
    manifest, answers, words = card.manifest, card.answers, texts()["croissant"]
    content: Json = {
        "@context": words["context"] | {term: f"cr:{term}" for term in words["terms"]},
        "@type": "sc:Dataset",
        "name": _name(card),
        "conformsTo": list(CONFORMS_TO),
        "description": (
            f"{_joined(answers, ('instances', 'purpose'))} README.md has the data sheet, "
            f"dataset.json the recipe. Content hash {manifest.content_hash}."
        ),
        # The part after the plus sign distinguishes data sets of other seeds or labels.
        "version": f"{card.identity.table_version}.0.0+{str(manifest.content_hash)[:12]}",
        "keywords": card.keywords,
        "isLiveDataset": False,
        **{f"rai:{name}": _joined(answers, keys) for name, keys in words["rai"].items()},
        "rai:dataCollectionType": "Secondary Data analysis" if card.is_recorded else "Experiments",
        "rai:machineAnnotationTools": "overtaking",
        "distribution": [part for name in card.schemas for part in _files(name, manifest.shards)],
        "recordSet": [_record_set(name, schema, card) for name, schema in card.schemas.items()],
    }
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def _name(card: Card) -> str:
    """A name without anything that an address would have to escape."""
    parts = [card.identity.profile, card.recording if card.is_recorded else card.identity.seed]
    return "overtaking-" + "-".join(re.sub(r"[^A-Za-z0-9_.]+", "-", str(part)) for part in parts)


def _joined(answers: Mapping[str, str], keys: tuple[str, ...]) -> str:
    """Some answers as plain text."""
    return " ".join(answers[key] for key in keys).replace("`", "")


def _files(table: str, shards: tuple[ShardRecord, ...]) -> list[Json]:
    """The files of a table, one by one with their checksums, and all of them as a set."""
    together = {
        "@type": "cr:FileSet",
        "@id": f"{table}-files",
        "name": f"{table}-files",
        "description": f"All files of the table {table}.",
        "encodingFormat": _PARQUET,
        "includes": f"{table}/*.parquet",
    }
    return [*(_file(table, shard) for shard in shards), together]


def _file(table: str, shard: ShardRecord) -> Json:
    """One file."""
    facts = shard.tables[table]
    stop = shard.first + shard.simulations
    path = f"{table}/{Shard(number=shard.number, first=shard.first, stop=stop).file_name}"
    return {
        "@type": "cr:FileObject",
        "@id": path,
        "name": path,
        "contentUrl": path,
        "contentSize": f"{facts.size_bytes} B",
        "encodingFormat": _PARQUET,
        "sha256": facts.sha256,
    }


def _record_set(table: str, schema: pa.Schema, card: Card) -> Json:
    """A table and its columns."""
    keys = ", ".join(KEYS[table])
    return {
        "@type": "cr:RecordSet",
        "@id": table,
        "name": table,
        "description": f"{card.num_rows(table)} rows, one for each {keys}.",
        "key": [{"@id": f"{table}/{key}"} for key in KEYS[table]],
        "field": [_field(table, field) for field in schema],
    }


def _field(table: str, field: pa.Field) -> Json:
    """A column."""
    unit = unit_text(field)
    kind = _data_type(field)
    return {
        "@type": "cr:Field",
        "@id": f"{table}/{field.name}",
        "name": field.name,
        "description": meaning_of(field) + (f" [{unit}]" if unit else ""),
        "dataType": [kind, "cr:Label"] if (table, field.name) == _CLASS else kind,
        "source": {
            "fileSet": {"@id": f"{table}-files"},
            "extract": {"column": field.name},
        },
    }


def _data_type(field: pa.Field) -> str:
    """The type of a column; Croissant 1.0 has none for bytes, and loaders give them for texts."""
    if pa.types.is_boolean(field.type):
        return "sc:Boolean"
    if pa.types.is_integer(field.type):
        return "sc:Integer"
    return "sc:Float" if pa.types.is_floating(field.type) else "sc:Text"
