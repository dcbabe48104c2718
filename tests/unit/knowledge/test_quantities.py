"""One entry: what it must say, and what it becomes."""

from __future__ import annotations

from typing import Any

import pytest

from overtaking.core.errors import KnowledgeError
from overtaking.core.units import mps_from_kmh
from overtaking.knowledge.quantities import is_entry, parse_distribution, parse_quantity

GOOD = {"value": 90.0, "unit": "km/h", "source": "a-law"}
SPREAD = {"value": 2.0, "sigma": 0.5, "unit": "m", "source": "a-law"}


def quantity(entry: dict[str, Any], name: str = "speed"):
    return parse_quantity(entry, name=name, where="a.toml [speed]", sources={"a-law"})


def distribution(entry: dict[str, Any], name: str = "time"):
    whole = {"unit": "s", "source": "a-law"} | entry
    return parse_distribution(whole, name=name, where="a.toml [time]", sources={"a-law"})


def without(key: str) -> dict[str, Any]:
    return {k: v for k, v in GOOD.items() if k != key}


def test_a_quoted_unit_becomes_si_and_stays_on_record():
    speed = quantity(GOOD)
    assert speed.value == 25.0
    assert (speed.unit, speed.quoted_unit, speed.source) == ("m/s", "km/h", "a-law")
    assert speed.sigma is None
    assert (speed.low, speed.high) == (25.0, 25.0)
    assert float(speed) == speed.number == 25.0


def test_a_name_with_a_suffix_keeps_the_unit_as_written():
    film = quantity({"value": 0.2, "unit": "mm", "source": "a-law"}, name="film_mm")
    assert (film.value, film.unit) == (0.2, "mm")


def test_a_spread_reaches_two_sigmas_unless_the_entry_says_otherwise():
    plain = quantity(SPREAD)
    assert (plain.sigma, plain.low, plain.high) == (0.5, 1.0, 3.0)
    cut = quantity(SPREAD | {"low": 1.75})
    assert (cut.low, cut.high) == (1.75, 3.0)


def test_a_spread_is_converted_with_its_value():
    speed = quantity(GOOD | {"sigma": 9.0, "high": 100.0})
    assert (speed.sigma, speed.low) == (2.5, 20.0)
    assert speed.high == mps_from_kmh(100.0)


def test_a_nested_list_becomes_nested_tuples():
    table = quantity({"value": [[36, 72.0], [0, 18]], "unit": "km/h", "source": "a-law"})
    assert table.value == ((10.0, 20.0), (0.0, 5.0))
    with pytest.raises(KnowledgeError, match="expected one number, got 2 entries"):
        float(table)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (without("unit"), "missing unit"),
        (without("source"), "missing source"),
        (without("value"), "missing value"),
        (GOOD | {"colour": 1}, "unknown key colour"),
        (GOOD | {"source": "hearsay"}, "unknown source: expected an id of sources.toml"),
        (GOOD | {"source": "choice"}, "missing rationale"),
        (GOOD | {"source": "choice", "rationale": "  "}, "missing rationale"),
        (GOOD | {"unit": "furlong"}, "unit: expected a product of known symbols, got 'furlong'"),
        (GOOD | {"unit": 3}, "got '3'"),
        (GOOD | {"value": "90"}, "expected a finite number, got 90"),
        (GOOD | {"value": True}, "expected a finite number, got True"),
        (GOOD | {"value": float("nan")}, "expected a finite number, got nan"),
        (GOOD | {"value": float("inf")}, "expected a finite number, got inf"),
        (GOOD | {"value": []}, "expected a finite number"),
        (GOOD | {"value": [1.0, "x"]}, "expected a finite number, got x"),
        (GOOD | {"sigma": 0.0}, "sigma > 0"),
        (GOOD | {"sigma": -1.0}, "sigma > 0"),
        (GOOD | {"low": 91.0}, "low <= value <= high"),
        (GOOD | {"high": 89.0}, "low <= value <= high"),
        (GOOD | {"value": [1.0, 2.0], "sigma": 1.0}, "beside one number only"),
    ],
)
def test_an_entry_that_says_too_little_or_nonsense_is_refused(entry: dict[str, Any], message: str):
    with pytest.raises(KnowledgeError) as caught:
        quantity(entry)
    text = str(caught.value)
    assert text.startswith("a.toml [speed]: ")
    assert message in text
    assert "\n" not in text


def test_a_unit_other_than_the_names_suffix_is_refused():
    with pytest.raises(KnowledgeError, match="expected mm, as the name film_mm says, got m"):
        quantity({"value": 0.2, "unit": "m", "source": "a-law"}, name="film_mm")


@pytest.mark.parametrize(
    ("entry", "parameters", "support"),
    [
        ({"distribution": "constant", "value": 2}, {"value": 2.0}, (2.0, 2.0)),
        (
            {"distribution": "normal", "mean": 2.0, "sigma": 0.5, "low": 1.0, "high": 3.5},
            {"mean": 2.0, "sigma": 0.5},
            (1.0, 3.5),
        ),
        (
            {"distribution": "lognormal", "median": 1.3, "sigma": 0.35, "low": 0.5, "high": 3.0},
            {"median": 1.3, "sigma": 0.35},
            (0.5, 3.0),
        ),
        ({"distribution": "bernoulli", "probability": 0.2}, {"probability": 0.2}, (0.0, 1.0)),
    ],
)
def test_every_kind_of_distribution_gives_parameters_and_support(
    entry: dict[str, Any], parameters: dict[str, Any], support: tuple[float, float]
):
    found = distribution(entry)
    assert dict(found.parameters) == parameters
    assert (found.low, found.high) == support
    assert (found.unit, found.source) == ("s", "a-law")


def test_a_logarithmic_sigma_and_a_probability_have_no_unit_to_convert():
    spread = {"median": 108.0, "sigma": 0.1, "low": 72.0, "high": 144.0}
    speed = distribution({"distribution": "lognormal", "unit": "km/h"} | spread)
    assert (speed.parameter("median"), speed.parameter("sigma")) == (30.0, 0.1)
    assert (speed.low, speed.high, speed.unit) == (20.0, 40.0, "m/s")
    flag = distribution({"distribution": "bernoulli", "unit": "km/h", "probability": 0.36})
    assert flag.parameter("probability") == 0.36


def test_the_spread_of_a_normal_has_the_unit_of_its_mean():
    spread = {"mean": 90.0, "sigma": 9.0, "low": 72.0, "high": 108.0}
    speed = distribution({"distribution": "normal", "unit": "km/h"} | spread)
    assert (speed.parameter("mean"), speed.parameter("sigma")) == (25.0, 2.5)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"distribution": "cauchy"}, "expected one of constant, normal"),
        (
            {"distribution": "normal", "mean": 2.0, "sigma": 0.5, "low": 3.0, "high": 1.0},
            "low < high",
        ),
        ({"distribution": "normal", "mean": 2.0, "sigma": 0.5}, "missing high"),
        (
            {"distribution": "normal", "mean": 9.0, "sigma": 0.5, "low": 1.0, "high": 3.0},
            "around the centre",
        ),
        (
            {"distribution": "normal", "mean": 2.0, "sigma": 0.0, "low": 1.0, "high": 3.0},
            "sigma > 0",
        ),
        (
            {"distribution": "lognormal", "median": 1.0, "sigma": 1.0, "low": 0.0, "high": 3.0},
            "parameters",
        ),
        ({"distribution": "bernoulli", "probability": 1.2}, "0 to 1, got 1.2"),
        ({"distribution": "constant", "value": [1.0]}, "a finite number"),
        ({"distribution": "constant", "value": 1.0, "mean": 1.0}, "unknown key mean"),
        ({"distribution": "constant", "value": 1.0, "source": "hearsay"}, "unknown source"),
        ({"distribution": "constant", "value": 1.0, "source": "choice"}, "missing rationale"),
    ],
)
def test_parameters_that_make_no_distribution_are_refused(entry: dict[str, Any], message: str):
    with pytest.raises(KnowledgeError) as caught:
        distribution(entry)
    assert str(caught.value).startswith("a.toml [time]: ")
    assert message in str(caught.value)


def test_a_distribution_cannot_be_changed_and_knows_its_parameters():
    found = distribution({"distribution": "constant", "value": 2.0})
    with pytest.raises(TypeError):
        found.parameters["value"] = 3.0  # pyright: ignore[reportIndexIssue]
    with pytest.raises(KnowledgeError, match="parameter: expected one of value, got mean"):
        found.parameter("mean")


def test_a_table_of_entries_is_no_entry():
    assert is_entry({"value": 1.0})
    assert is_entry({"unit": "m"})
    assert not is_entry({"length": {"value": 1.0}})
    assert not is_entry({"value": {"value": 1.0}})
    assert not is_entry(1.0)
