"""Numbers of the law: `quantity` declares one, and sentences about rules print them."""

import re
from typing import Any

from overtaking.knowledge.quantities import ENGINEERING_CHOICE, Quantity, parse_quantity
from overtaking.knowledge.toml_reader import load_toml, sources

_PLACEHOLDER = re.compile(r"\{((?:law|law_de|friction)\.[\w.]+)\}")
_FACTORS = {("m/s", "km/h"): 3.6}
"""Factors from the unit of a file to another unit."""


def quantity(
    value: float, unit: str, source: str = ENGINEERING_CHOICE, *, why: str | None = None
) -> Quantity:
    """Declare a number of a law, with its unit and its source.

    Args:
        value: The number in `unit`, as its source states it.
        unit: Unit of the number, such as "km/h"; the check of a rule reads it in SI.
        source: Id of a source of `sources.toml`; by default the number is a choice of this package.
        why: Reason for this value. A choice must state one.

    Raises:
        KnowledgeError: The unit or the source is unknown, or a choice has no reason.
    """
    entry: dict[str, Any] = {"value": value, "unit": unit, "source": source}
    if why is not None:
        entry["rationale"] = why
    return parse_quantity(entry, name="", where=f"quantity({value:g}, {unit!r})", sources=sources())


def amount(path: str, *, unit: str = "", times: float = 1.0) -> str:
    """A number of the knowledge base with its unit, such as `50 m`.

    Sentences about a rule print the number that its check reads, so that the two cannot differ.

    Args:
        path: File without suffix and dotted name of the entry: `law.slow.distance` is
            `slow.distance` in `law.toml`.
        unit: Unit to print; the unit of the file if left out.
        times: Factor on the number.
    """
    return f"{bare(path, unit=unit, times=times)} {unit or _read_entry(path)[1]}"


def bare(path: str, *, unit: str = "", times: float = 1.0) -> str:
    """Format a number without its unit, for the arguments of `amount`."""
    value, file_unit = _read_entry(path)
    factor = _FACTORS[file_unit, unit] if unit and unit != file_unit else 1.0
    # Three digits turn 8.33 m/s into 30 km/h; no number of a law has more than three.
    return f"{value * factor * times:.3g}"


def fill_placeholders(text: str) -> str:
    """Replace each placeholder such as `{law.slow.distance}` by its `amount`."""
    return _PLACEHOLDER.sub(lambda match: amount(match[1]), text)


def _read_entry(path: str) -> tuple[float, str]:
    """Number and unit of an entry, as in its file."""
    file, _, name = path.partition(".")
    entry = load_toml(f"{file}.toml")
    for part in name.split("."):
        entry = entry[part]
    return float(entry["value"]), str(entry["unit"])
