"""A manifest comes back as it was written, and says in one line why it cannot."""

from __future__ import annotations

import dataclasses
import json
import os
from typing import TYPE_CHECKING

import pytest

import overtaking as ot
from overtaking.core.errors import DatasetError, SchemaError
from overtaking.data.location import PARTIAL, Folder
from overtaking.data.manifest import (
    FILE_NAME,
    VERSION,
    Identity,
    Manifest,
    content_hash,
    read_manifest,
    write_manifest,
)
from overtaking.data.recipe import Keep
from overtaking.model.known_roads import known_road
from overtaking.scenarios.profiles import load_specification

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def written(manifest: Manifest, tmp_path: Path) -> Path:
    """A folder with a manifest."""
    write_manifest(Folder(tmp_path), manifest)
    return tmp_path


def test_a_manifest_comes_back_as_it_was_written(manifest: Manifest, written: Path):
    assert read_manifest(Folder(written)) == manifest
    assert list((written / PARTIAL).iterdir()) == []


def test_the_road_comes_back_to_the_last_bit(manifest: Manifest, written: Path):
    road = read_manifest(Folder(written)).identity.road
    assert road == known_road("town06")
    assert road.heading.hex() == known_road("town06").heading.hex()


def test_a_course_comes_back_and_a_road_without_one_does_not_name_it(
    manifest: Manifest, written: Path
):
    assert "course" not in json.loads((written / FILE_NAME).read_text())["identity"]["road"]
    identity = manifest.identity.model_copy(update={"road": known_road("rural")})
    changed = manifest.model_copy(update={"identity": identity})
    write_manifest(Folder(written), changed)
    assert read_manifest(Folder(written)) == changed


def test_an_origin_comes_back_and_a_road_without_one_does_not_name_it(
    manifest: Manifest, written: Path
):
    road = json.loads((written / FILE_NAME).read_text())["identity"]["road"]
    assert {"origin_x", "origin_y"} & road.keys() == set()
    moved = dataclasses.replace(known_road("town06"), origin_x=691_000.0, origin_y=5_335_000.0)
    identity = manifest.identity.model_copy(update={"road": moved})
    write_manifest(Folder(written), manifest.model_copy(update={"identity": identity}))
    assert read_manifest(Folder(written)).identity.road == moved


def test_the_specification_comes_back(manifest: Manifest, written: Path):
    assert load_specification(read_manifest(Folder(written)).identity.spec) == load_specification(
        "pinto2023-physical"
    )


def change(folder: Path, **values: object) -> None:
    path = folder / FILE_NAME
    path.write_text(json.dumps({**json.loads(path.read_text()), **values}))


def test_a_newer_version_says_to_upgrade(written: Path):
    change(written, version=VERSION + 1, something="new")
    with pytest.raises(
        SchemaError, match=f"at most {VERSION}, got {VERSION + 1}; use the version"
    ) as caught:
        read_manifest(Folder(written))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "got"),
    [
        ("", "Invalid JSON: EOF"),
        ("{", "Invalid JSON: EOF"),
        ("[]", "Input should be an object"),
        ("[" * 100_000, "Invalid JSON: recursion limit"),
        ("9" * 100_000, "Invalid JSON: number out of range"),
        ("[" + "0," * 2_000_000 + "0]", "more than 2000000 values"),
        ('{"format": "something else", "version": 1}', "another kind of file"),
        ('{"format": "overtaking.dataset", "version": "new"}', "another kind of file"),
        ('{"format": "overtaking.dataset", "version": true}', "another kind of file"),
        ('{"format": "overtaking.dataset", "version": 1}', "identity: Field required"),
    ],
)
def test_what_is_no_manifest_is_refused(text: str, got: str, tmp_path: Path):
    (tmp_path / FILE_NAME).write_text(text)
    with pytest.raises(DatasetError, match=got) as caught:
        read_manifest(Folder(tmp_path))
    assert "\n" not in str(caught.value)
    assert str(tmp_path / FILE_NAME) in str(caught.value)


def test_bytes_that_are_no_text_are_refused(tmp_path: Path):
    (tmp_path / FILE_NAME).write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DatasetError, match="got Invalid JSON"):
        read_manifest(Folder(tmp_path))


def test_a_folder_without_a_manifest_is_named(tmp_path: Path):
    with pytest.raises(DatasetError, match=r"got a folder without dataset\.json"):
        read_manifest(Folder(tmp_path))


def test_a_pipe_and_a_device_are_refused_unread(tmp_path: Path):
    os.mkfifo(tmp_path / FILE_NAME)
    with pytest.raises(DatasetError, match="got a pipe or a device"):
        read_manifest(Folder(tmp_path))
    (tmp_path / FILE_NAME).unlink()
    (tmp_path / FILE_NAME).symlink_to("/dev/zero")
    with pytest.raises(DatasetError, match="got a pipe or a device"):
        read_manifest(Folder(tmp_path))


def test_a_huge_file_is_refused(tmp_path: Path):
    with (tmp_path / FILE_NAME).open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(DatasetError, match="got a file of more than 67108864 bytes"):
        read_manifest(Folder(tmp_path))


@pytest.mark.parametrize(
    ("path", "value", "key"),
    [
        ("identity.simulations", 0, "identity.simulations"),
        ("identity.simulations", 10**13, "identity.simulations"),
        ("identity.shard_size", 0, "identity.shard_size"),
        ("identity.shard_size", True, "identity.shard_size"),
        ("identity.shard_size", 2.0, "identity.shard_size"),
        ("identity.shard_size", 10**9, "shards that do not follow"),
        ("identity.seed", -1, "identity.seed"),
        ("identity.seed", 10**400, "identity.seed"),
        ("identity.spec", {"time": 3}, "identity.spec: specification: profile"),
        ("identity.spec.time.horizon_s", -1, "identity.spec: specification: time.horizon_s"),
        ("identity.road.length", 0, "identity.road: road town06: length"),
        ("identity.road.lanes", [], "identity.road"),
        ("identity.keep", "all", "identity.keep"),
        ("identity.table_version", "1", "identity.table_version"),
        ("shards", [], "complete, but without shards"),
        ("shards.0.simulations", 0, "shards.0.simulations"),
        ("shards.0.simulations", 10**12, "shards that do not follow"),
        ("shards.1.number", 7, "shards that do not follow"),
        ("shards.1.first", 1, "shards that do not follow"),
        ("shards.0.tables.simulations.rows", "2", "shards.0.tables.simulations.rows"),
        ("shards.0.tables", [1], "shards.0.tables"),
        ("content_hash", None, "complete, but without shards or hash"),
        ("content_hash", "ef", "content_hash"),
        ("complete", 1, "complete"),
        ("provenance.packages", {"numpy": 2}, "provenance.packages.numpy"),
    ],
)
def test_a_value_that_no_data_set_has_is_named(path: str, value: object, key: str, written: Path):
    file = written / FILE_NAME
    content = part = json.loads(file.read_text())
    *way, last = [int(one) if one.isdecimal() else one for one in path.split(".")]
    for one in way:
        part = part[one]
    part[last] = value
    file.write_text(json.dumps(content))
    with pytest.raises(DatasetError, match=rf"\A[^\n]*got [^\n]*{key}[^\n]*\Z"):
        read_manifest(Folder(written))


def test_an_unknown_key_is_refused(written: Path):
    change(written, colour="blue")
    with pytest.raises(DatasetError, match="colour: Extra inputs"):
        read_manifest(Folder(written))


@pytest.mark.parametrize(
    ("name", "changed"),
    [
        ("seed", {"seed": 2}),
        ("simulations", {"num_simulations": 4}),
        ("shard_size", {"shard_size": 7}),
        ("keep", {"keep": Keep.FEATURES}),
        ("road", {"road": known_road("motorway")}),
        ("spec", {"spec": load_specification("pinto2023-physical", {"time.horizon_s": "19.0"})}),
    ],
)
def test_whatever_decides_the_content_decides_the_fingerprint(name, changed, recipe, simulator):
    one = Identity.of(recipe, simulator)
    other = Identity.of(dataclasses.replace(recipe, **changed), simulator)
    assert one.differences(other) == [name]
    assert one.fingerprint != other.fingerprint


def test_another_version_of_the_model_is_another_identity(recipe, simulator):
    newer = dataclasses.replace(simulator, version="2")
    one, other = (Identity.of(recipe, by) for by in (simulator, newer))
    assert one.differences(other) == ["simulator_version"]
    assert one.fingerprint != other.fingerprint


def test_the_machine_is_no_part_of_the_identity(recipe, simulator):
    elsewhere = dataclasses.replace(simulator, details={"simd": "avx512"})
    one, other = (Identity.of(recipe, by) for by in (simulator, elsewhere))
    assert one == other
    assert one.fingerprint == other.fingerprint


def test_the_content_hash_looks_at_values_and_not_at_bytes(manifest: Manifest):
    def with_facts(**changes: object):
        first = manifest.shards[0]
        facts = dataclasses.replace(first.tables["simulations"], **changes)
        return (first.model_copy(update={"tables": {"simulations": facts}}), manifest.shards[1])

    assert content_hash(with_facts(sha256="00", size_bytes=1)) == content_hash(manifest.shards)
    assert content_hash(with_facts(content="00")) != content_hash(manifest.shards)
    assert content_hash(manifest.shards[:1]) != content_hash(manifest.shards)


def test_a_profile_in_place_of_a_data_set_is_named_with_the_command_that_makes_one():
    step = "overtaking generate motorway --out data/motorway"
    with pytest.raises(DatasetError, match=f"got a profile; make a data set from it: {step}"):
        ot.load_dataset("motorway")
