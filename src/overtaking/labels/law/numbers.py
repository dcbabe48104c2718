"""Numbers of the law, formatted for the sentences about its rules."""

import re

from overtaking.knowledge.toml_reader import load_toml

_PLACEHOLDER = re.compile(r"\{((?:law|law_de|friction)\.[\w.]+)\}")
_FACTORS = {("m/s", "km/h"): 3.6}
"""Factors from the unit of a file to another unit."""


def amount(path: str, *, unit: str = "", times: float = 1.0) -> str:
    """A number of the knowledge base with its unit, such as `0.8 m`.

    Sentences about a rule print the number that its check reads, so that the two cannot differ.

    Args:
        path: File without suffix and dotted name of the entry: `law.side.motor` is `side.motor` in
            `law.toml`.
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
    """Replace each placeholder such as `{law.side.motor}` by its `amount`."""
    return _PLACEHOLDER.sub(lambda match: amount(match[1]), text)


def _read_entry(path: str) -> tuple[float, str]:
    """Number and unit of an entry, as in its file."""
    file, _, name = path.partition(".")
    entry = load_toml(f"{file}.toml")
    for part in name.split("."):
        entry = entry[part]
    return float(entry["value"]), str(entry["unit"])
