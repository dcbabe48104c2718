"""A walk over every file of the knowledge base."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path
from typing import Any, cast

import pytest

import overtaking
from overtaking.knowledge.quantities import Quantity
from overtaking.knowledge.toml_reader import DATA_FOLDER, all_quantities, load_toml, sources

WORDS = {"law_sentences.toml", "sources.toml", "glossary.toml"}
"""The files without numbers."""

FILES = sorted({path.name for path in DATA_FOLDER.glob("*.toml")} - WORDS)
OURS = [
    "colours.toml",
    "friction.toml",
    "carla_weather.toml",
    "vehicle_classes.toml",
    "weather.toml",
]


def count_numbers(item: Any) -> int:
    """How many leaves of a TOML document are numbers or lists of them."""
    if isinstance(item, dict):
        return sum(count_numbers(part) for part in cast("dict[str, Any]", item).values())
    if isinstance(item, list):
        return sum(count_numbers(part) for part in cast("list[Any]", item))
    return int(isinstance(item, int | float) and not isinstance(item, bool))


def count_parsed(item: Any) -> int:
    """How many numbers of the file an entry accounts for."""
    return count_numbers(
        {key: part for key, part in item.items() if key not in ("unit", "source", "rationale")}
    )


def test_the_files_are_there():
    assert set(OURS) <= set(FILES)


@pytest.mark.parametrize("file", FILES)
def test_every_quantity_has_a_unit_and_a_known_source_or_a_reason(file: str):
    found = all_quantities(file)
    assert found
    for name, entry in found.items():
        assert entry.unit, name
        assert entry.quoted_unit, name
        if entry.source == "choice":
            assert entry.rationale, name
            assert len(entry.rationale.split()) >= 2, name
        else:
            assert entry.source in sources(), name


@pytest.mark.parametrize("file", FILES)
def test_no_number_of_a_file_is_left_out(file: str):
    document = load_toml(file)
    accounted = 0
    for name in all_quantities(file):
        item: Any = document
        for part in name.split("."):
            item = item[part]
        accounted += count_parsed(item)
    assert accounted == count_numbers(document)


@pytest.mark.parametrize("file", FILES)
def test_values_lie_within_their_own_limits(file: str):
    for name, entry in all_quantities(file).items():
        if isinstance(entry, Quantity) and not isinstance(entry.value, tuple):
            assert cast("float", entry.low) <= entry.value <= cast("float", entry.high), name


FILLED_BY_RECORDS = {
    "carla_props.toml",
    "carla_vehicles.toml",
    "carla_weather.toml",
    "colours.toml",
    "drivers.toml",
    "paper.toml",
    "roads.toml",
    "validation.toml",
    "vehicle_classes.toml",
}
"""Files that are read as whole records, which refuse an entry without a field."""


def pattern_of_name(node: ast.AST) -> str | None:
    """A regular expression of the names that a string of the code stands for, if it has a dot.

    In an f-string such as `f"model.perception.detection_time_{light}"` a part between braces
    stands for any word.
    """
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        pattern = re.escape(node.value)
    elif isinstance(node, ast.JoinedStr):
        parts = (
            re.escape(str(part.value)) if isinstance(part, ast.Constant) else r"[\w-]+"
            for part in node.values
        )
        pattern = "".join(parts)
    else:
        return None
    has_words = re.search(r"\w", pattern.replace(r"[\w-]+", ""))
    return pattern if has_words and re.fullmatch(r"[\w\\.\-\[\]+]+", pattern) else None


@cache
def names_in_code() -> re.Pattern[str]:
    """The names of entries and of whole tables in the strings of the package."""
    patterns: set[str] = set()
    for path in Path(overtaking.__file__).parent.rglob("*.py"):
        nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        patterns |= {pattern for node in nodes if (pattern := pattern_of_name(node))}
    dotted = sorted(pattern for pattern in patterns if r"\." in pattern)
    return re.compile(f"(?:{'|'.join(dotted)})(?:\\..*)?")


@pytest.mark.parametrize("file", sorted(set(FILES) - FILLED_BY_RECORDS))
def test_the_code_names_every_entry_of_a_file(file: str):
    stem = file.removesuffix(".toml")
    # Some modules add the name of the file, or of the file and a table, to names of entries.
    unread = [
        name
        for name in all_quantities(file)
        if not names_in_code().fullmatch(f"{stem}.{name}") and not names_in_code().fullmatch(name)
    ]
    assert unread == []
