"""Files into typed values; every way in which a file can be wrong."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, dataclass
from typing import TYPE_CHECKING

import numpy as np
import pytest

from overtaking.core.errors import KnowledgeError
from overtaking.knowledge.quantities import Distribution, Quantity
from overtaking.knowledge.toml_reader import (
    all_quantities,
    constant,
    load_toml,
    number,
    numbers_below,
    read_record,
    sources,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Toml = Callable[[str], Path]

LENGTH = 'length = { value = 4.4, sigma = 0.2, unit = "m", source = "sumo-vtype-defaults" }\n'
SPEEDS = 'speeds = { value = [36, 72], unit = "km/h", source = "bosch-handbook" }\n'


@dataclass(frozen=True, slots=True, kw_only=True)
class Inner:
    gap: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Everything:
    name: str
    is_used: bool
    length: Quantity
    time: Distribution
    speeds: tuple[float, ...]
    count: int
    inner: Inner
    extra: Quantity | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class OnlyLength:
    length: Quantity


@dataclass(frozen=True, slots=True, kw_only=True)
class PlainLength:
    length: float


WHOLE = (
    """
[a.b]
name = "example"
is_used = true
time = { distribution = "constant", value = 2, unit = "s", source = "green-2000" }
count = { value = 3, unit = "1", source = "choice", rationale = "three" }
inner.gap = { value = 2.5, unit = "m", source = "sumo-vtype-defaults" }
"""
    + LENGTH
    + SPEEDS
)


def test_a_section_fills_a_dataclass_field_by_field(toml: Toml):
    found = read_record(Everything, toml(WHOLE), "a.b")
    assert (found.name, found.is_used) == ("example", True)
    assert (found.length.value, found.length.sigma) == (4.4, 0.2)
    assert (found.time.kind, found.time.low, found.time.high) == ("constant", 2.0, 2.0)
    assert found.speeds == (10.0, 20.0)
    assert found.count == 3
    assert type(found.count) is int
    assert found.inner == Inner(gap=2.5)
    assert found.extra is None


def test_what_was_read_cannot_be_changed(toml: Toml):
    found = read_record(OnlyLength, toml(LENGTH))
    with pytest.raises(FrozenInstanceError):
        found.length.value = 5.0  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (LENGTH + SPEEDS, "unknown key speeds: expected the keys length"),
        ("", "missing key length: expected the keys length, got none"),
        (LENGTH.replace(', unit = "m"', ""), "missing unit"),
        (LENGTH.replace(', source = "sumo-vtype-defaults"', ""), "missing source"),
        (LENGTH.replace("sumo-vtype-defaults", "hearsay"), "unknown source"),
        (LENGTH.replace("sumo-vtype-defaults", "choice"), "missing rationale"),
        (LENGTH.replace("sigma", "sgima"), "unknown key sgima"),
        ("length = 4.4", "expected a table with value, unit and source, got 4.4"),
        ("length = {}", "expected a table with value, unit and source"),
        ("length = 4.4 m", "expected a readable TOML file"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line_that_names_it(toml: Toml, text: str, message: str):
    with pytest.raises(KnowledgeError) as caught:
        read_record(OnlyLength, toml(text))
    assert str(caught.value).startswith("example.toml")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "example"', "name = 3", "expected a str, got 3"),
        ("is_used = true", 'is_used = "yes"', "expected a bool, got yes"),
        ("value = 3,", "value = 3.5,", "expected a whole number, got 3.5"),
        ("value = [36, 72]", "value = 36", "expected a list, got 10.0"),
        ("value = 2.5", "value = [2.5]", "expected one number"),
        ("inner.gap = {", "inner = {", "expected a table"),
        ('distribution = "constant", value = 2', "value = 1", "one of constant"),
    ],
)
def test_an_item_of_another_type_than_its_field_is_refused(
    toml: Toml, old: str, new: str, message: str
):
    assert old in WHOLE
    with pytest.raises(KnowledgeError) as caught:
        read_record(Everything, toml(WHOLE.replace(old, new)), "a.b")
    assert message in str(caught.value)


def test_a_plain_field_takes_the_value_in_si(toml: Toml):
    text = 'length = { value = 250.0, unit = "mm", source = "bosch-handbook" }'
    assert read_record(PlainLength, toml(text)).length == 0.25


@pytest.mark.parametrize("section", ["c", "a.c", "a.b.length", "a.b.name"])
def test_a_section_that_does_not_exist_is_refused(toml: Toml, section: str):
    with pytest.raises(KnowledgeError, match=r"example\.toml: section \["):
        read_record(Everything, toml(WHOLE), section)


def test_a_missing_file_is_refused(tmp_path: Path):
    with pytest.raises(KnowledgeError, match=r"^nowhere\.toml: file: expected a readable TOML"):
        all_quantities(tmp_path / "nowhere.toml")


def test_quantities_are_named_by_their_path_in_the_order_of_the_file(toml: Toml):
    found = all_quantities(toml(WHOLE))
    assert list(found) == ["a.b.time", "a.b.count", "a.b.inner.gap", "a.b.length", "a.b.speeds"]
    assert isinstance(found["a.b.time"], Distribution)
    assert isinstance(found["a.b.length"], Quantity)


def test_file_and_entry_are_one_path_to_a_number():
    assert number("weather.fog.clear_range") == 10000.0
    assert number("drivers.mixed.classes.T.time_gap_factor") == 1.3


def test_a_constant_is_the_number_rounded_to_float32():
    rounded = constant("model.nature.gravity")
    assert isinstance(rounded, np.float32)
    assert rounded == np.float32(number("model.nature.gravity"))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("weather.fog.width", "weather.toml [fog.width]: entry: expected a quantity, got none"),
        ("drivers.mixed.careful.time_gap", "expected a quantity, got a lognormal distribution"),
        ("friction.table.new", "expected one number, got 3 entries"),
        ("nowhere.fog", "nowhere.toml: file: expected a readable TOML file"),
    ],
)
def test_a_path_without_a_scalar_quantity_is_refused(name: str, message: str):
    with pytest.raises(KnowledgeError) as caught:
        number(name)
    assert message in str(caught.value)


@pytest.mark.parametrize("bare", ["3", "3.5", "[1, 2]", "1979-05-27"])
def test_a_number_outside_an_entry_is_refused(toml: Toml, bare: str):
    with pytest.raises(KnowledgeError, match=r"example\.toml \[a\.x\]: entry: expected a table"):
        all_quantities(toml(f"[a]\nx = {bare}\n"))


def test_a_source_says_what_it_is_and_whether_it_was_read():
    for id_, source in sources().items():
        assert source.id == id_
        assert len(source.citation) > 20
        assert "http" not in source.citation
        assert isinstance(source.checked, bool)
    assert "choice" not in sources()


ROWS = """
[columns]
word = {}
length = { unit = "m", source = "bosch-handbook" }
speeds = { unit = "km/h", source = "choice", rationale = "two speeds" }

[rows]
first = ["a", 1.0, [36, 72]]
second = ["b", 2.0, [18, 36]]
"""

LINES = """
[labels]
name = { S = "small", T = "truck", B = "bicycle" }

[quantities]
width = { S = 1.5, T = { value = 2.5, sigma = 0.1 }, B = { value = 0.6, rationale = "narrow" }, $ }
speed = { S = 36, T = { value = 18, source = "bosch-handbook" }, B = 9, $ }
""".replace("$ }\n", 'unit = "m", source = "choice", rationale = "typical" }\n', 1).replace(
    "$ }", 'unit = "km/h", source = "choice", rationale = "typical" }'
)

TABLES_WITH_BASE = """
[calm.traits]
length = { value = 1.0, unit = "m", source = "bosch-handbook" }
width = { value = 2.0, unit = "m", source = "bosch-handbook" }
[calm.classes.T]
factor = { value = 3.0, unit = "1", source = "bosch-handbook" }
[hurried]
base = "calm"
[hurried.traits]
height = { value = 4.0, unit = "m", source = "bosch-handbook" }
length = { value = 5.0, unit = "m", source = "bosch-handbook" }
[late]
base = "hurried"
"""


def values_by_name(file: Path) -> dict[str, object]:
    return {name: getattr(entry, "value", None) for name, entry in all_quantities(file).items()}


def test_a_row_gives_each_value_the_unit_and_source_of_its_column(toml: Toml):
    file = toml(ROWS)
    assert load_toml(file)["second"]["word"] == "b"
    entries = all_quantities(file)
    assert list(entries) == ["first.length", "first.speeds", "second.length", "second.speeds"]
    speeds = entries["second.speeds"]
    assert isinstance(speeds, Quantity)
    assert speeds.value == (5.0, 10.0)
    assert (speeds.unit, speeds.quoted_unit) == ("m/s", "km/h")
    assert (speeds.source, speeds.rationale) == ("choice", "two speeds")


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ('["b", 2.0]', "[second]: entry: expected 3 values, got 2 values"),
        ('["b", 2.0, [18, 36], 1.0]', "expected 3 values, got 4 values"),
        ('["b", true, [18, 36]]', "expected a finite number"),
    ],
)
def test_a_row_with_a_missing_or_wrong_value_is_refused(toml: Toml, row: str, message: str):
    with pytest.raises(KnowledgeError) as caught:
        all_quantities(toml(ROWS.replace('["b", 2.0, [18, 36]]', row)))
    assert message in str(caught.value)


def test_a_line_gives_each_item_its_value_and_the_items_own_source_wins(toml: Toml):
    file = toml(LINES)
    assert list(load_toml(file)) == ["S", "T", "B"]
    assert load_toml(file)["T"]["name"] == "truck"
    entries = all_quantities(file)
    assert values_by_name(file) == {
        "S.width": 1.5,
        "S.speed": 10.0,
        "T.width": 2.5,
        "T.speed": 5.0,
        "B.width": 0.6,
        "B.speed": 2.5,
    }
    width = entries["T.width"]
    assert isinstance(width, Quantity)
    assert (width.sigma, width.rationale) == (0.1, "typical")
    assert entries["B.width"].rationale == "narrow"
    assert (entries["T.speed"].source, entries["T.speed"].rationale) == ("bosch-handbook", None)


def test_a_line_without_a_value_for_each_item_is_refused(toml: Toml):
    with pytest.raises(KnowledgeError, match=r"\[speed\]: entry: expected a value for S, T, B"):
        load_toml(toml(LINES.replace("B = 9, ", "")))


def test_a_table_takes_from_its_base_what_it_does_not_state(toml: Toml):
    values = values_by_name(toml(TABLES_WITH_BASE))
    traits = {"traits.length": 5.0, "traits.width": 2.0, "traits.height": 4.0}
    for name in ("hurried", "late"):
        below = {
            key.removeprefix(f"{name}."): value
            for key, value in values.items()
            if key.startswith(f"{name}.")
        }
        assert below == traits | {"classes.T.factor": 3.0}
        # The order decides which random number a trait gets.
        assert list(below) == [*traits, "classes.T.factor"]
    assert values["calm.traits.length"] == 1.0


@pytest.mark.parametrize("base", ["late", "nowhere", "hurried", "calm.traits.length"])
def test_a_base_that_is_no_table_above_is_refused(toml: Toml, base: str):
    text = TABLES_WITH_BASE.replace('base = "calm"', f'base = "{base}"')
    with pytest.raises(KnowledgeError, match="as base a table above this one"):
        load_toml(toml(text))


def test_the_numbers_below_a_table_lack_sources_and_reasons(toml: Toml):
    file = toml(WHOLE)
    numbers = numbers_below(file, "a.b")
    length = {"value": 4.4, "sigma": 0.2, "low": 4.4 - 0.4, "high": 4.4 + 0.4, "unit": "m"}
    assert numbers["length"] == length
    constant = {"kind": "constant", "value": 2.0, "low": 2.0, "high": 2.0, "unit": "s"}
    assert numbers["time"] == constant
    assert numbers == numbers_below(toml(WHOLE.replace('"three"', '"four"')), "a.b")
