"""Numbers of the law as its sentences name them."""

import re

from overtaking.knowledge.reader import load

_PLACE = re.compile(r"\{((?:law|law_de|friction)\.[\w.]+)\}")
_PER_UNIT = {("m/s", "km/h"): 3.6}


def amount(path: str, *, unit: str = "", times: float = 1.0) -> str:
    """A number of the knowledge base with its unit, such as `0.8 m`.

    Sentences about a rule print the number that its check reads, so that the two cannot differ.

    Args:
        path: File and dotted name of the entry, such as `law.side.motor`.
        unit: The unit to print; that in which the file has it if left out.
        times: A factor.
    """
    return f"{bare(path, unit=unit, times=times)} {unit or _written(path)[1]}"


def bare(path: str, *, unit: str = "", times: float = 1.0) -> str:
    """The number without its unit; the arguments are those of `amount`."""
    value, written_in = _written(path)
    factor = _PER_UNIT[written_in, unit] if unit and unit != written_in else 1.0
    # Three digits: 8.33 m/s are 30 km/h, and no number of a law has more.
    return f"{value * factor * times:.3g}"


def filled(text: str) -> str:
    """A text in which places such as `{law.side.motor}` are replaced by their `amount`."""
    return _PLACE.sub(lambda place: amount(place[1]), text)


def _written(path: str) -> tuple[float, str]:
    """Number and unit of an entry as its file has them."""
    file, _, name = path.partition(".")
    entry = load(f"{file}.toml")
    for part in name.split("."):
        entry = entry[part]
    return float(entry["value"]), str(entry["unit"])
