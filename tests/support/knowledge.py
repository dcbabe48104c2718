"""Sections of knowledge files as attributes, for tests that work a formula out by hand."""

from __future__ import annotations

from types import SimpleNamespace

from overtaking.knowledge.quantities import Quantity
from overtaking.knowledge.toml_reader import all_quantities


def numbers_of(file: str) -> SimpleNamespace:
    """The values of a file such as `weather.toml`: `numbers_of(file).fog.clear_range`."""
    sections: dict[str, dict[str, object]] = {}
    for name, entry in all_quantities(file).items():
        section, _, key = name.partition(".")
        assert isinstance(entry, Quantity), name
        sections.setdefault(section, {})[key] = entry.value
    return SimpleNamespace(**{name: SimpleNamespace(**one) for name, one in sections.items()})


def weather_maps() -> SimpleNamespace:
    """What the percentages of the weather mean."""
    return numbers_of("weather.toml")
