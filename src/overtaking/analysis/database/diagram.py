"""The entity-relationship diagram, for Mermaid and in SVG."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape

from overtaking.analysis.database.entities import Attribute, Relation, entities, relations
from overtaking.core.errors import check_choice

if TYPE_CHECKING:
    from collections.abc import Mapping

FORMATS = ("svg", "mermaid")

_SHOWN = 9
_ROW, _HEAD, _PAD = 17, 26, 8
_WIDTH, _GAP_X, _GAP_Y, _MARGIN = 250, 110, 28, 24
_FOOT, _LEAD = 9, 22
_INK, _SOFT, _LINE, _FILL, _HEAD_FILL = "#1b2733", "#5c6b7a", "#8796a5", "#ffffff", "#e6edf3"


@dataclass(frozen=True, slots=True)
class _Box:
    """Where an entity is drawn [px]."""

    x: int
    y: int
    height: int
    rows: tuple[str, ...]


def diagram(form: str) -> str:
    """The diagram of all tables.

    Args:
        form: `svg` or `mermaid`.

    Raises:
        ConfigError: There is no such form.
    """
    check_choice(form, FORMATS, what="--format", where="er")
    return mermaid() if form == "mermaid" else svg()


def mermaid() -> str:
    """The diagram in Mermaid's language, with every column."""
    lines = ["erDiagram"]
    for one in relations():
        left = "|o" if one.is_optional else "||"
        right = "o|" if one.is_single else "o{"
        lines.append(f'    {one.one} {left}--{right} {one.many} : "{", ".join(one.columns)}"')
    for name, attributes in entities().items():
        lines.append(f"    {name} {{")
        lines += [f"        {_mermaid_row(one)}" for one in attributes]
        lines.append("    }")
    return "\n".join(lines) + "\n"


def svg() -> str:
    """The diagram as a picture, with the keys and the first columns of each table."""
    boxes = _laid_out()
    width = max(box.x for box in boxes.values()) + _WIDTH + _MARGIN
    height = max(box.y + box.height for box in boxes.values()) + _MARGIN
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}" font-family="Helvetica, Arial, sans-serif" font-size="12" role="img">',
        "<title>Tables of a data set and their relations</title>",
        f'<rect width="{width}" height="{height}" fill="{_FILL}"/>',
        *(_connection(one, boxes) for one in relations()),
        *(part for name, box in boxes.items() for part in _box(name, box)),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _mermaid_row(one: Attribute) -> str:
    keys = ", ".join(word for word, has in (("PK", one.is_key), ("FK", one.refers_to)) if has)
    unit = f'"{one.unit}"' if one.unit != "1" else ""
    return " ".join(part for part in (one.kind, one.name, keys, unit) if part)


def _laid_out() -> dict[str, _Box]:
    """A column for each number of steps from a table that refers to nothing."""
    columns: dict[int, list[str]] = {}
    for name in entities():
        columns.setdefault(_depth(name), []).append(name)
    rows = {name: _rows(attributes) for name, attributes in entities().items()}
    tall = {name: _HEAD + _ROW * len(shown) + _PAD for name, shown in rows.items()}
    heights = {
        depth: sum(tall[name] + _GAP_Y for name in names) - _GAP_Y
        for depth, names in columns.items()
    }
    boxes: dict[str, _Box] = {}
    for depth, names in sorted(columns.items()):
        x, y = _MARGIN + depth * (_WIDTH + _GAP_X), _MARGIN
        y += (max(heights.values()) - heights[depth]) // 2
        for name in names:
            boxes[name] = _Box(x, y, tall[name], rows[name])
            y += tall[name] + _GAP_Y
    return boxes


def _depth(name: str) -> int:
    return max((1 + _depth(one.one) for one in relations() if one.many == name), default=0)


def _rows(attributes: tuple[Attribute, ...]) -> tuple[str, ...]:
    """The lines in the box of a table, keys first."""
    ordered = sorted(attributes, key=lambda one: not one.is_key)
    shown = ordered if len(ordered) <= _SHOWN + 1 else ordered[:_SHOWN]
    more = len(ordered) - len(shown)
    names = tuple(f"{'*' if one.is_key else ''}{one.name}|{one.kind}" for one in shown)
    return (*names, f"and {more} more|") if more else names


def _box(title: str, box: _Box) -> list[str]:
    """A table: its name, and a line for each column, underlined if it is part of the key."""
    parts = [
        f'<rect x="{box.x}" y="{box.y}" width="{_WIDTH}" height="{box.height}" rx="5" '
        f'fill="{_FILL}" stroke="{_INK}"/>',
        f'<path d="M{box.x} {box.y + _HEAD}v{5 - _HEAD}q0 -5 5 -5h{_WIDTH - 10}'
        f'q5 0 5 5v{_HEAD - 5}z" fill="{_HEAD_FILL}" stroke="{_INK}"/>',
        f'<text x="{box.x + 10}" y="{box.y + 18}" font-weight="bold" font-size="13" '
        f'fill="{_INK}">{escape(title)}</text>',
    ]
    for number, row in enumerate(box.rows):
        label, kind = row.split("|")
        y = box.y + _HEAD + _ROW * (number + 1) - 2
        style = ' text-decoration="underline"' if label.startswith("*") else ""
        name = escape(label.lstrip("*"))
        parts.append(f'<text x="{box.x + 10}" y="{y}" fill="{_INK}"{style}>{name}</text>')
        if kind:
            parts.append(
                f'<text x="{box.x + _WIDTH - 10}" y="{y}" text-anchor="end" fill="{_SOFT}">'
                f"{escape(kind)}</text>"
            )
    return parts


def _connection(one: Relation, boxes: Mapping[str, _Box]) -> str:
    """A line from the one to the many, with a bar at the one and a crow's foot at the many."""
    left, right = boxes[one.one], boxes[one.many]
    x1, x2 = left.x + _WIDTH, right.x
    y1, y2 = _port(one, boxes, is_start=True), _port(one, boxes, is_start=False)
    bend = (x2 - x1) // 2
    path = f"M{x1} {y1}h{_LEAD}C{x1 + bend} {y1} {x2 - bend} {y2} {x2 - _LEAD} {y2}H{x2}"
    bar = f"M{x1 + 8} {y1 - 6}v12"
    foot = f"M{x2} {y2 - 6}L{x2 - _FOOT} {y2}L{x2} {y2 + 6}"
    end = f"M{x2 - 8} {y2 - 6}v12" if one.is_single else foot
    ring = (
        f'<circle cx="{x1 + 16}" cy="{y1}" r="4" fill="{_FILL}" stroke="{_LINE}"/>'
        if one.is_optional
        else ""
    )
    about = f"{one.one} to {one.many} by {', '.join(one.columns)}"
    return (
        f'<g fill="none" stroke="{_LINE}" stroke-width="1.4"><title>{escape(about)}</title>'
        f'<path d="{path}{bar}{end}"/>{ring}</g>'
    )


def _port(one: Relation, boxes: Mapping[str, _Box], *, is_start: bool) -> int:
    """The height at which a line leaves or reaches a box: lines of a box stand apart, in order."""
    name = one.one if is_start else one.many
    mine = [each for each in relations() if name == (each.one if is_start else each.many)]
    mine.sort(key=lambda each: boxes[each.many if is_start else each.one].y)
    box = boxes[name]
    return box.y + round(box.height * (mine.index(one) + 1) / (len(mine) + 1))
