"""The little Markdown that the generated pages need."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

NOTE = "<!-- Made by docs/generate.py; do not edit. -->\n\n"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; pipes inside cells are escaped."""
    lines = [header, ["---"] * len(header), *rows]
    return "".join(
        f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |\n" for cells in lines
    )


def page(title: str, *parts: str) -> str:
    """A page with its title, and a note for whoever wants to change it."""
    return f"# {title}\n\n{NOTE}" + "\n".join(part.rstrip() + "\n" for part in parts)


def section(title: str, *parts: str) -> str:
    """A section of a page."""
    return f"## {title}\n\n" + "\n".join(part.rstrip() + "\n" for part in parts)


def unit(text: str) -> str:
    """A unit as people write it: m/s² for `m/s^2`, nothing for `1`."""
    for power in "234":
        text = text.replace(f"^{power}", "⁰¹²³⁴"[int(power)])
    return {"1": "", "percent": "%", "deg": "°"}.get(text, text)
