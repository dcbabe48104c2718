"""The few SVG elements that the figures need, as text."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

FONT = "system-ui, -apple-system, 'Segoe UI', Helvetica, Arial, 'DejaVu Sans', sans-serif"

Point = tuple[float, float]


def number(value: float) -> str:
    """A length in pixels, to a hundredth, without trailing zeros."""
    return f"{value:.2f}".rstrip("0").rstrip(".").replace("-0", "0" if abs(value) < 0.005 else "-0")


def element(tag: str, content: str = "", /, **attributes: object) -> str:
    """An element; underscores in the names of attributes become hyphens."""
    words = [tag]
    for name, value in attributes.items():
        if value is not None:
            shown = number(value) if isinstance(value, int | float) else str(value)
            words.append(f'{name.rstrip("_").replace("_", "-")}="{shown}"')
    return f"<{' '.join(words)}>{content}</{tag}>" if content else f"<{' '.join(words)}/>"


def group(parts: Iterable[str], **attributes: object) -> str:
    """Elements that share attributes."""
    return element("g", "".join(parts), **attributes)


def label(at: Point, content: str, fill: str, size: float = 13, **attributes: object) -> str:
    """A text with its baseline at a point."""
    return element("text", content, x=at[0], y=at[1], fill=fill, font_size=size, **attributes)


def line(start: Point, end: Point, stroke: str, width: float = 1, **attributes: object) -> str:
    """A straight line."""
    (x1, y1), (x2, y2) = start, end
    return element(
        "line", x1=x1, y1=y1, x2=x2, y2=y2, stroke=stroke, stroke_width=width, **attributes
    )


def box(at: Point, size: Point, fill: str, **attributes: object) -> str:
    """A rectangle by its upper left corner and its size."""
    return element("rect", x=at[0], y=at[1], width=size[0], height=size[1], fill=fill, **attributes)


def curve(points: Sequence[Point], stroke: str, width: float = 1.5, **attributes: object) -> str:
    """A line through points."""
    path = "M" + "L".join(f"{number(x)},{number(y)}" for x, y in points)
    return element(
        "path",
        d=path,
        fill="none",
        stroke=stroke,
        stroke_width=width,
        stroke_linejoin="round",
        stroke_linecap=attributes.pop("stroke_linecap", "round"),
        **attributes,
    )


def document(size: Point, title: str, parts: Iterable[str]) -> str:
    """A whole drawing with a name for those who cannot see it."""
    content = element("title", title) + "\n" + "\n".join(parts) + "\n"
    return element(
        "svg",
        content,
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {number(size[0])} {number(size[1])}",
        width=size[0],
        height=size[1],
        role="img",
        font_family=FONT,
    )
