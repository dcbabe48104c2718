"""The diagram follows from the schemas of the tables."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest

from overtaking.analysis.database.diagram import diagram, mermaid, svg
from overtaking.analysis.database.entities import entities, relations
from overtaking.analysis.database.views import VIEWS
from overtaking.core.errors import ConfigError
from overtaking.data.tables.schemas import KEYS, SCHEMAS

PAIRS = {(one.one, one.many): one for one in relations()}


def test_every_column_of_every_table_is_an_attribute():
    assert {name: [each.name for each in columns] for name, columns in entities().items()} == {
        name: schema.names for name, schema in SCHEMAS.items()
    }


def test_the_keys_are_those_of_the_tables():
    for name, columns in entities().items():
        assert {each.name for each in columns if each.is_key} == set(KEYS[name])


def test_the_papers_relations_are_there():
    frames = PAIRS["simulations", "frames"]
    assert not frames.is_single
    assert not frames.is_optional
    assert PAIRS["weather", "simulations"].columns == ("weather",)
    assert {pair for pair in PAIRS if pair[1] == "states"} == {
        ("vehicles", "states"),
        ("frames", "states"),
    }


def test_names_that_mean_different_things_join_nothing():
    # Both have a column `policy`: one names rules, the other ways of measuring.
    assert ("labels", "features") not in PAIRS


def test_what_follows_from_other_relations_is_left_out():
    assert ("simulations", "states") not in PAIRS


def test_no_table_comes_back_to_itself():
    def ancestors(name: str) -> set[str]:
        above = {one for one, many in PAIRS if many == name}
        return above | {each for one in above for each in ancestors(one)}

    for name in SCHEMAS:
        assert name not in ancestors(name)


def test_mermaid_has_a_block_for_each_table_and_a_line_for_each_relation():
    text = mermaid()
    assert text.startswith("erDiagram\n")
    for name in SCHEMAS:
        assert f"    {name} {{\n" in text
    assert "simulations ||--o{ frames" in text
    assert sum("--o" in line for line in text.splitlines()) == len(PAIRS)


def test_the_picture_is_xml_with_every_table_and_relation():
    root = ET.fromstring(svg())
    space = "{http://www.w3.org/2000/svg}"
    texts = {one.text for one in root.iter(f"{space}text")}
    assert set(SCHEMAS) <= texts
    assert len(root.findall(f"{space}g")) == len(PAIRS)


def test_the_diagram_is_the_same_every_time():
    assert svg() == svg()
    with pytest.raises(ConfigError, match="svg or mermaid"):
        diagram("png")


def test_the_papers_entities_are_the_views():
    assert {view.name for view in VIEWS} == {
        "Simulations",
        "Frames",
        "EgoVehicle",
        "Vehicles",
        "Weather",
    }
