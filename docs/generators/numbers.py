"""Fills the tables of numbers in `explanation/model.md` from the knowledge base.

A table is asked for by a comment that names symbols and entries; it stands between that and
`<!-- end -->`:

    <!-- numbers: model.toml
    $k_p$ steering.position_gain
    -->
"""

from __future__ import annotations

import re

from generators.knowledge import shown, source_link
from generators.markdown import table, unit

from overtaking.knowledge.toml_reader import all_quantities

_BLOCK = re.compile(r"(<!-- numbers: (\S+)\n(.*?)\n-->\n\n).*?(<!-- end -->)", re.DOTALL)
_HEADER = ("symbol", "value", "unit", "entry", "source")


def filled(text: str) -> str:
    """The page with all its tables of numbers as the knowledge base has them now."""
    return _BLOCK.sub(_block, text)


def _block(found: re.Match[str]) -> str:
    opening, file, lines, closing = found.groups()
    return (
        f"{opening}{table(_HEADER, [_row(file, line) for line in lines.splitlines()])}\n{closing}"
    )


def _row(file: str, line: str) -> tuple[str, ...]:
    symbol, _, key = line.rpartition(" ")
    entry = all_quantities(file)[key]
    link = source_link(entry.source).replace("(sources", "(../reference/sources")
    return symbol, shown(entry), unit(entry.quoted_unit), f"`{key}`", link
