"""The entity-relationship diagram follows from the schemas of the tables."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest

from overtaking.analysis.database.diagram import diagram, mermaid, svg
from overtaking.analysis.database.entities import entities, relations
from overtaking.analysis.database.views import VIEWS
from overtaking.core.errors import ConfigError
from overtaking.data.tables.schemas import KEYS, SCHEMAS

RELATIONS = {(relation.one, relation.many): relation for relation in relations()}
"""Relations by the names of the table that is referred to and of the table that refers to it."""


def test_every_column_of_every_table_is_an_attribute():
    assert {name: [column.name for column in columns] for name, columns in entities().items()} == {
        name: schema.names for name, schema in SCHEMAS.items()
    }


def test_the_keys_of_an_entity_are_the_keys_of_its_table():
    for name, columns in entities().items():
        assert {column.name for column in columns if column.is_key} == set(KEYS[name])


def test_the_diagram_contains_the_relations_of_the_paper():
    frames = RELATIONS["simulations", "frames"]
    assert not frames.is_single
    assert not frames.is_optional
    assert RELATIONS["weather", "simulations"].columns == ("weather",)
    assert {pair for pair in RELATIONS if pair[1] == "states"} == {
        ("vehicles", "states"),
        ("frames", "states"),
    }


def test_columns_of_equal_name_and_different_meaning_are_no_relation():
    # Column `policy` of both tables: it names rules in `labels`, ways of measuring in `features`.
    assert ("labels", "features") not in RELATIONS


def test_a_relation_that_follows_from_others_is_left_out():
    assert ("simulations", "states") not in RELATIONS


def test_no_table_is_its_own_ancestor():
    def ancestors(name: str) -> set[str]:
        parents = {parent for parent, many in RELATIONS if many == name}
        return parents | {ancestor for parent in parents for ancestor in ancestors(parent)}

    for name in SCHEMAS:
        assert name not in ancestors(name)


def test_mermaid_has_a_block_for_each_table_and_a_line_for_each_relation():
    text = mermaid()
    assert text.startswith("erDiagram\n")
    for name in SCHEMAS:
        assert f"    {name} {{\n" in text
    assert "simulations ||--o{ frames" in text
    assert sum("--o" in line for line in text.splitlines()) == len(RELATIONS)


def test_the_svg_contains_every_table_and_relation():
    root = ET.fromstring(svg())
    namespace = "{http://www.w3.org/2000/svg}"
    texts = {element.text for element in root.iter(f"{namespace}text")}
    assert set(SCHEMAS) <= texts
    assert len(root.findall(f"{namespace}g")) == len(RELATIONS)


def test_the_svg_is_reproducible_and_another_format_is_refused():
    assert svg() == svg()
    with pytest.raises(ConfigError, match="svg or mermaid"):
        diagram("png")


def test_the_views_are_the_entities_of_the_paper():
    assert {view.name for view in VIEWS} == {
        "Simulations",
        "Frames",
        "EgoVehicle",
        "Vehicles",
        "Weather",
    }
