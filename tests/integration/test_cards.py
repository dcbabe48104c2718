"""A data set tells others what it is: people by README.md, programs by croissant.json."""

from __future__ import annotations

import errno
import fnmatch
import hashlib
import json
import re
import shutil
from typing import TYPE_CHECKING, Any

import duckdb
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.support.recordings import Mover, commonroad

import overtaking as ot
from overtaking.core.errors import DatasetError
from overtaking.data import completion
from overtaking.data.card import Card, size_category, texts
from overtaking.data.croissant import croissant
from overtaking.data.manifest import BalanceRecord, Source

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

SIZE = 6
HORIZON = {"time.horizon_s": 1.0, "time.attempt_deadline_s": 1.0}
MOVERS = (
    Mover(number=7, s=20.0, speed=30.0, moves=((4.0, 1), (14.0, 0)), last=250),
    Mover(number=3, s=80.0, speed=24.0, last=250),
)
CARDS = ("README.md", "croissant.json")


def generate(out: Path, **settings: Any) -> ot.Dataset:
    return ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=SIZE,
        seed=3,
        out=out,
        overrides=HORIZON,
        shard_size=4,
        **settings,
    )


@pytest.fixture(scope="module", params=["frames", "features", "recording"])
def data(request, tmp_path_factory) -> ot.Dataset:
    folder = tmp_path_factory.mktemp(request.param)
    if request.param != "recording":
        return generate(folder / "data", keep=request.param)
    scene = folder / "scene.xml"
    scene.write_text(commonroad(MOVERS), encoding="utf-8")
    return ot.import_recording("commonroad", scene, folder / "data")


@pytest.fixture(scope="module")
def told(data: ot.Dataset) -> dict[str, Any]:
    return json.loads((data.path / "croissant.json").read_text(encoding="utf-8"))


def files(data: ot.Dataset) -> list[str]:
    """The Parquet files of a data set, as its folder has them."""
    return sorted(path.relative_to(data.path).as_posix() for path in data.path.glob("*/*.parquet"))


def parts(told: dict[str, Any], kind: str) -> list[dict[str, Any]]:
    """The files or sets of files."""
    return [one for one in told["distribution"] if one["@type"] == f"cr:{kind}"]


def nodes(value: Any) -> Iterator[dict[str, Any]]:
    """Every object in a JSON document."""
    if isinstance(value, dict):
        yield value
        for one in value.values():
            yield from nodes(one)
    if isinstance(value, list):
        for one in value:
            yield from nodes(one)


def test_every_file_is_named_with_its_length_and_checksum(data, told):
    named = {one["contentUrl"]: one for one in parts(told, "FileObject")}
    assert sorted(named) == files(data)
    for name, one in named.items():
        content = (data.path / name).read_bytes()
        assert one["sha256"] == hashlib.sha256(content).hexdigest()
        assert one["contentSize"] == f"{len(content)} B"


def test_a_set_of_files_holds_those_of_its_table(data, told):
    sets = {one["@id"]: one["includes"] for one in parts(told, "FileSet")}
    for table in told["recordSet"]:
        (source,) = {field["source"]["fileSet"]["@id"] for field in table["field"]}
        found = [name for name in files(data) if fnmatch.fnmatch(name, sets[source])]
        assert found == [name for name in files(data) if name.startswith(f"{table['name']}/")]
        assert found


def test_names_are_unique_and_references_lead_somewhere(told):
    defined = [one["@id"] for one in nodes(told) if "@type" in one and "@id" in one]
    referred = {one["@id"] for one in nodes(told["recordSet"]) if set(one) == {"@id"}}
    assert len(set(defined)) == len(defined)
    assert referred <= set(defined)
    assert referred


def test_every_column_is_a_field_of_its_type(data, told):
    assert {table["name"] for table in told["recordSet"]} == {
        name.partition("/")[0] for name in files(data)
    }
    for table in told["recordSet"]:
        schema = pq.read_schema(data.path / table["name"] / "part-00000.parquet")
        assert [field["source"]["extract"]["column"] for field in table["field"]] == schema.names
        for field, column in zip(table["field"], schema, strict=True):
            assert field["@id"] == f"{table['name']}/{column.name}"
            kind = field["dataType"]
            assert (kind[0] if isinstance(kind, list) else kind) == data_type(column.type)


def data_type(kind: pa.DataType) -> str:
    """The type in Croissant of one in Arrow."""
    name = str(kind.value_type if pa.types.is_dictionary(kind) else kind)
    known = {"bool": "Boolean", "float": "Float", "double": "Float", "string": "Text"}
    known["fixed_size_binary[16]"] = "Text"
    return f"sc:{known.get(name, 'Integer')}"


def test_every_field_tells_meaning_unit_and_gaps(data, told):
    for table in told["recordSet"]:
        schema = pq.read_schema(data.path / table["name"] / "part-00000.parquet")
        for field, column in zip(table["field"], schema, strict=True):
            unit = column.metadata[b"unit"].decode()
            text = field["description"]
            assert text.startswith(column.metadata[b"description"].decode())
            assert ("[" in text) == (unit != "1")
            assert unit == "1" or f"[{unit}" in text
            assert ("may be null" in text) == column.nullable


def test_the_keys_tell_rows_apart(data, told):
    for table in told["recordSet"]:
        keys = [one["@id"].partition("/")[2] for one in table["key"]]
        rows = pq.read_table(data.path / table["name"]).to_pandas()
        assert not rows.duplicated(keys).any()
        assert table["description"].startswith(f"{len(rows)} rows")


def test_the_context_declares_every_term_of_croissant(told):
    context = told["@context"]
    terms = {key for one in nodes(told) for key in one if not key.startswith("@")}
    ours = {"field", "source", "fileSet", "extract", "column", "key", "recordSet", "includes"}
    assert ours <= terms
    assert all(context[name] == f"cr:{name}" for name in ours)
    prefixes = {name.partition(":")[0] for name in terms if ":" in name}
    assert prefixes == {"rai"}
    assert context["rai"] == "http://mlcommons.org/croissant/RAI/"
    assert told["conformsTo"][0] == "http://mlcommons.org/croissant/1.0"


def test_the_head_of_the_card_configures_every_table_that_has_rows(data):
    head = (data.path / "README.md").read_text(encoding="utf-8").split("---\n")[1]
    found = re.findall(
        r'^- config_name: (\w+)\n(  default: true\n)?  data_files: "(.+)"$', head, re.M
    )
    filled = {name for name in data.manifest.shards[0].tables if data.table(name).num_rows}
    assert {name for name, _, _ in found} == filled
    assert [name for name, default, _ in found if default] == ["features"]
    for name, _, pattern in found:
        matching = [file for file in files(data) if fnmatch.fnmatch(file, pattern)]
        assert matching == [file for file in files(data) if file.startswith(f"{name}/")]
    assert "license" not in head


def test_the_datasheet_answers_every_question(data):
    text = (data.path / "README.md").read_text(encoding="utf-8")
    sheet = text.partition("\n## Datasheet\n")[2].partition("\n## ")[0]
    asked = [one["asked"] for chapter in texts()["chapters"] for one in chapter["questions"]]
    found = re.findall(r"^- \*\*(.+)\.\*\* (.+)$", sheet, re.MULTILINE)
    assert [question for question, _ in found] == asked
    assert all(answer.endswith(".") for _, answer in found)
    assert not re.search(r"[{}]|None\b(?! (is|was)|[.:])", sheet)


def test_the_datasheet_counts_what_is_there(data):
    text = (data.path / "README.md").read_text(encoding="utf-8")
    assert f"{len(data)} in all, with {len(data.vehicles())} vehicles" in text
    kept = (
        f"{data.table('states').num_rows} rows"
        if "states" in data.manifest.shards[0].tables
        else ""
    )
    assert (kept or "was not kept") in text


def test_what_is_said_of_a_recording_is_not_said_of_a_simulation(data, told):
    imported = data.manifest.identity.source is not None
    assert ("owners" in told["rai:personalSensitiveInformation"]) == imported
    assert ("Philox" in told["rai:dataCollection"]) == (not imported)
    assert all(name in told["rai:dataCollectionMissingData"] for name in ["weather"] if imported)
    assert (data.simulations()["weight"] == 1.0).all()


def test_duckdb_reads_every_table_as_it_is(data):
    with duckdb.connect() as database:
        for name in data.manifest.shards[0].tables:
            found = database.execute(f"select * from '{data.path / name}/*.parquet'")
            rows = pq.read_table(data.path / name)
            assert [column[0] for column in found.description] == rows.column_names
            assert found.fetchall() == [tuple(row.values()) for row in rows.to_pylist()]


@pytest.mark.ci
def test_the_same_recipe_tells_the_same_whatever_the_folder(tmp_path):
    one, other = generate(tmp_path / "one"), generate(tmp_path / "another" / "one")
    for name in CARDS:
        assert (one.path / name).read_bytes() == (other.path / name).read_bytes()
        assert str(tmp_path) not in (one.path / name).read_text(encoding="utf-8")


def test_labelling_again_makes_them_anew(data, tmp_path):
    copy = shutil.copytree(data.path, tmp_path / "data")
    before = {name: (copy / name).read_bytes() for name in CARDS}
    for name in CARDS:
        (copy / name).write_text("spoiled", encoding="utf-8")
    ot.relabel_dataset(copy)
    assert {name: (copy / name).read_bytes() for name in CARDS} == before


def test_a_full_disk_leaves_no_half_of_one_and_resuming_completes_it(tmp_path, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(completion, "croissant", full)
        with pytest.raises(DatasetError, match="No space left"):
            generate(tmp_path / "data")
    assert not (tmp_path / "data" / "croissant.json").exists()
    made = generate(tmp_path / "data", resume=True)
    assert json.loads((made.path / "croissant.json").read_text(encoding="utf-8"))["recordSet"]


def full(*_: object) -> str:
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_strange_name_breaks_neither_file(data):
    strange = 'a"b\n---\nlicense: mit\n<b>|`\udcff\x85é'
    source = Source(format="highd", files={strange: "0" * 64}, recording=strange)
    identity = data.manifest.identity.model_copy(update={"source": source})
    card = Card(data.manifest.model_copy(update={"identity": identity}))
    title = card.header().splitlines()[1]
    assert title == 'pretty_name: "Overtaking scenes: a\\"b?---?license: mit??b?????é"'
    assert card.readme().encode().count(b"\n---\n") == 1
    found = json.loads(croissant(card))
    assert re.fullmatch(r"[\w.-]+", found["name"], re.ASCII)


def test_the_lines_that_the_page_on_sharing_tells_to_add_fit(data, repository):
    page = (repository / "docs/how-to/share-a-data-set.md").read_text(encoding="utf-8")
    (lines,) = re.findall(r"^ *```json\n(.+?)^ *```$", page, re.DOTALL | re.MULTILINE)
    text = (data.path / "croissant.json").read_text(encoding="utf-8")
    before, after = json.loads(text), json.loads(text.replace("{", "{" + lines, 1))
    assert set(after) - set(before) == {"license", "url", "creator", "datePublished"}
    (query,) = re.findall(r"^```sql\n(.+?)^```$", page, re.DOTALL | re.MULTILINE)
    with duckdb.connect() as database:
        rows = database.execute(query.replace("data/pinto", str(data.path))).fetchall()
    assert sum(count for _, count in rows) == len(data)


def test_a_balanced_data_set_is_called_a_selection(data):
    identity = data.manifest.identity.model_copy(update={"source": None})
    natural = data.manifest.model_copy(update={"identity": identity})
    balance = BalanceRecord(candidates=500, outside=0, missing=0, cells={})
    sheet = Card(natural.model_copy(update={"balance": balance})).datasheet()
    assert "of 500 candidates" in sheet
    assert "None was left out" not in sheet
    assert "None was left out" in Card(natural).datasheet()


@pytest.mark.parametrize(
    ("number", "name"),
    [(1, "n<1K"), (999, "n<1K"), (1000, "1K<n<10K"), (276_000, "100K<n<1M"), (10**12, "n>1T")],
)
def test_sizes_have_the_names_of_the_hub(number, name):
    assert size_category(number) == name
