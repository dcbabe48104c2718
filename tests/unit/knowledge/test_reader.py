"""Files into typed values; every way in which a file can be wrong."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, dataclass
from typing import TYPE_CHECKING

import pytest

from overtaking.core.errors import KnowledgeError
from overtaking.knowledge.quantities import Distribution, Quantity
from overtaking.knowledge.toml_reader import all_quantities, number, read_record, sources

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
time = { distribution = "uniform", low = 1, high = 2, unit = "s", source = "green-2000" }
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
    assert (found.time.kind, found.time.low, found.time.high) == ("uniform", 1.0, 2.0)
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
        ('distribution = "uniform", low = 1, high = 2', "value = 1", "one of constant"),
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


def test_a_number_is_asked_for_by_its_path(toml: Toml):
    assert number(toml(WHOLE), "a.b.length") == 4.4
    assert number("friction.toml", "table.sliding_ratio") < 1.0


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.b.width", "example.toml [a.b.width]: entry: expected a quantity, got none"),
        ("a.b.time", "example.toml [a.b.time]: entry: expected a quantity, got a uniform dist"),
        ("a.b.speeds", "expected one number, got 2 entries"),
    ],
)
def test_what_is_no_number_is_refused_as_one(toml: Toml, name: str, message: str):
    with pytest.raises(KnowledgeError) as caught:
        number(toml(WHOLE), name)
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
