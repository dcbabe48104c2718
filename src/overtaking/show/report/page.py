"""The page: sections as HTML, with everything that it needs inside it."""

import base64
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files
from itertools import pairwise
from typing import NamedTuple

from overtaking.analysis.stats.table import Table

_PHONE = "(max-width: 44rem)"  # As in the style sheet.
_FEW_NUMBERS = 4  # Columns of numbers that fit a phone with their names written across.

# Nothing may be loaded from anywhere, whatever a data set's names hold. Films lie beside the page,
# and so does the page in which simulations run.
_POLICY = (
    "default-src 'none'; img-src data:; media-src 'self' file:; frame-src 'self' file:; "
    "style-src 'unsafe-inline'"
)


class Section(NamedTuple):
    """A part of the page.

    Attributes:
        name: Its anchor.
        title: Its heading.
        blocks: Its HTML, in order.
    """

    name: str
    title: str
    blocks: Sequence[str]


def page(
    title: str, lead: str, facts: Sequence[tuple[str, str]], sections: Sequence[Section], foot: str
) -> str:
    """The whole page.

    Args:
        title: Its heading.
        lead: One line below it.
        facts: Facts about the data, as names and values.
        sections: Its parts.
        foot: The last line.
    """
    style = files("overtaking.show.report").joinpath("page.css").read_text(encoding="utf-8")
    known = "".join(
        f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in facts
    )
    links = "".join(f'<a href="#{one.name}">{escape(one.title)}</a>' for one in sections)
    body = "\n".join(
        f'<section id="{one.name}">\n<h2>{escape(one.title)}</h2>\n{"".join(one.blocks)}</section>'
        for one in sections
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<main>\n"
        f'<h1>{escape(title)}</h1>\n<p class="lead">{escape(lead)}</p>\n'
        f'<dl class="facts">{known}</dl>\n<nav aria-label="Contents">{links}</nav>\n'
        f"{body}\n<footer>{escape(foot)}</footer>\n</main>\n</body>\n</html>\n"
    )


def paragraph(text: str) -> str:
    """A paragraph."""
    return f"<p>{escape(text)}</p>\n"


def definitions(pairs: Iterable[tuple[str, str]], colours: dict[str, str] | None = None) -> str:
    """Names with their meanings; a class has the patch of its colour."""
    rows = "".join(
        f"<dt>{_named(name, colours or {})}</dt><dd>{escape(text)}</dd>" for name, text in pairs
    )
    return f'<dl class="meanings">{rows}</dl>\n'


def remarks(notes: Iterable[str], warnings: Iterable[str] = ()) -> str:
    """Notes and warnings, each in a box."""
    items = [f'<li class="warning">{escape(one)}</li>' for one in warnings]
    items += [f"<li>{escape(one)}</li>" for one in notes]
    return f'<ul class="remarks">{"".join(items)}</ul>\n' if items else ""


def quotations(texts: Iterable[str]) -> str:
    """Paragraphs to be quoted, one below the other."""
    said = "".join(f"<p>{escape(one)}</p>" for one in texts)
    return f'<blockquote class="verdicts">{said}</blockquote>\n' if said else ""


def missing(text: str) -> str:
    """A place where something would be, with the reason why it is not."""
    return f'<div class="missing">{escape(text)}</div>\n'


def figure_block(name: str, svg: bytes, caption: str, narrow: bytes | None = None) -> str:
    """A figure with its caption and the files that hold it.

    Args:
        name: Name of the files.
        svg: The figure.
        caption: The words below it.
        narrow: The figure for a phone; without it, a phone scrolls the wide one in its box.
    """
    source = f'<source media="{_PHONE}" srcset="{_embedded(narrow)}">' if narrow else ""
    kinds = ", ".join(
        f'<a href="figures/{name}.{kind}">{kind.upper()}</a>' for kind in ("svg", "pdf", "png")
    )
    return (
        f'<figure id="figure-{name}"><picture>{source}<img alt="{escape(caption)}" '
        f'src="{_embedded(svg)}"></picture>'
        f'<figcaption>{escape(caption)} <span class="files">({kinds})</span></figcaption>'
        "</figure>\n"
    )


def film_block(path: str, caption: str) -> str:
    """A film that lies beside the page.

    Args:
        path: The file, relative to the page.
        caption: The words below it.
    """
    start = f"{escape(path)}#t=1"  # Browsers show this frame before they play; the first is empty.
    return (
        f'<figure class="film"><video controls preload="metadata" src="{start}"></video>'
        f'<figcaption>{escape(caption)} <span class="files">(<a href="{escape(path)}">MP4</a>)'
        "</span></figcaption></figure>\n"
    )


def view_block(path: str, caption: str) -> str:
    """A page beside this one in which simulations run, in a frame.

    Args:
        path: The file, relative to the page.
        caption: The words below it.
    """
    source, words = escape(path), escape(caption)
    return (
        f'<figure class="view"><iframe src="{source}#theme=light" title="{words}" loading="lazy">'
        f'</iframe><figcaption>{words} <span class="files">(<a href="{source}">alone</a>)'
        "</span></figcaption></figure>\n"
    )


def _embedded(svg: bytes) -> str:
    return f"data:image/svg+xml;base64,{base64.b64encode(svg).decode('ascii')}"


def table_block(table: Table, colours: dict[str, str]) -> str:
    """A table with its note and the files that hold it.

    Args:
        table: The table.
        colours: Colour of each class; those that head a column or a row get a patch of theirs.
    """
    head = "".join(
        f"<th{_kind(table, number)}>{_named(name, colours)}</th>"
        for number, name in enumerate(table.header)
    )
    rows = table.cells()
    firsts = [True, *(before[0] != row[0] for before, row in pairwise(rows))]
    body = "".join(
        _row(table, row, colours, is_first=is_first)
        for row, is_first in zip(rows, firsts, strict=False)
    )
    kinds = ", ".join(
        f'<a href="tables/{table.name}.{kind}">{text}</a>'
        for kind, text in (("tex", "LaTeX"), ("csv", "CSV"))
    )
    crowd = ' class="many"' if len(table.header) - table.num_texts > _FEW_NUMBERS else ""
    if len(table.header) == table.num_texts:
        crowd = ' class="texts"'
    return (
        f'<div class="wide"><table id="table-{table.name}"{crowd}>'
        f"<caption>{escape(table.title)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
        f'<p class="note">{escape(table.note)} ({kinds})</p>\n'
    )


def _row(table: Table, cells: list[str], colours: dict[str, str], *, is_first: bool) -> str:
    """One row; what repeats the row above is left out."""
    shown = list(cells)
    if not is_first and not table.by_column:
        shown[:2] = ["", ""]
    parts = "".join(
        f"<td{_kind(table, number)}>{_named(cell, colours)}</td>"
        for number, cell in enumerate(shown)
    )
    return f'<tr class="first">{parts}</tr>' if is_first else f"<tr>{parts}</tr>"


def _kind(table: Table, column: int) -> str:
    return ' class="text"' if column < table.num_texts else ""


def _named(text: str, colours: dict[str, str]) -> str:
    """A text, with the patch of its class if it is one."""
    colour = colours.get(text, "")
    patch = f'<span class="swatch" style="background:{colour}"></span>'
    return (patch if colour else "") + escape(text)
