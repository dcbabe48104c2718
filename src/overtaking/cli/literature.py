"""Tables of the literature: systems, data sets, factors and studies."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from overtaking.cli import options
from overtaking.cli.output import Output

if TYPE_CHECKING:
    from rich.console import Group

AsPrinted = Annotated[
    bool, options.option("--as-printed", "Print the values as in the paper, without corrections.")
]
With = Annotated[Path | None, options.option("--own DATA", "Add a row for a data set of your own.")]


_PROPERTIES = {
    "night": "nights",
    "rain": "rain",
    "snow": "snow",
    "dawn": "dawn or dusk",
    "urban": "traffic in towns",
    "highway": "traffic on highways",
    "residential": "residential streets",
    "rural": "country roads",
    "campus": "roads of a campus",
    "lidar": "a lidar",
    "radar": "a radar",
    "boxes3d": "boxes in three dimensions",
}
Wanted = dataclasses.make_dataclass(
    "Wanted",
    [
        (word, Annotated[bool, options.option(f"--{word}", f"Only data sets with {text}.")], False)
        for word, text in _PROPERTIES.items()
    ],
)


def systems(output: Output, as_printed: AsPrinted = False) -> None:
    """List driving systems: SAE level, comfort and safety."""
    from overtaking.analysis.literature.answers import answer

    found = answer("systems", is_corrected=not as_printed)
    rows = [
        (row["name"], _mark(row, "sae_level"), row["comfort"], row["safety"], row["does"])
        for row in found["rows"]
    ]
    header = ("system", "SAE level", "comfort", "safety", "what it does")
    output.result(found, lambda _: _drawn(header, rows, found))


def datasets(
    output: Output,
    wanted: Wanted,  # pyright: ignore[reportInvalidTypeForm, reportUnknownParameterType]
    own: With = None,
    as_printed: AsPrinted = False,
) -> None:
    """List driving data sets with the properties you need."""
    from overtaking.analysis.literature.answers import answer
    from overtaking.api import datasets as api_datasets

    dataset = None if own is None else api_datasets.load_dataset(own)
    words = [word for word, is_wanted in dataclasses.asdict(wanted).items() if is_wanted]
    found = answer("datasets", wanted=words, own=dataset, is_corrected=not as_printed)
    header = ("data set", "year", "scenes", "hours", "frames", "3D", "seen in", "roads")
    output.result(found, lambda _: _drawn(header, [_dataset(row) for row in found["rows"]], found))


def factors(output: Output) -> None:
    """List factors of the difficulty of driving, with our columns."""
    from overtaking.analysis.literature.answers import answer

    found = answer("factors")
    rows = [
        (row["name"], row["kind"], row["acts"], ", ".join(row["columns"]) or "none")
        for row in found["rows"]
    ]
    output.result(found, lambda _: _drawn(("factor", "kind", "how", "our columns"), rows, found))


def studies(output: Output) -> None:
    """List studies of overtaking decisions, with our columns."""
    from overtaking.analysis.literature.answers import answer

    found = answer("studies")
    rows = [
        (
            row["name"] if number == 0 else "",
            factor["name"],
            "" if factor["accuracy_percent"] is None else f"{factor['accuracy_percent']:.1f} %",
            ", ".join(factor["columns"]) or "none",
        )
        for row in found["rows"]
        for number, factor in enumerate(row["factors"] or [_NOTHING])
    ]
    header = ("study", "factor", "accuracy so far", "our columns")
    output.result(found, lambda _: _drawn(header, rows, found))


_NOTHING: dict[str, Any] = {
    "name": "names no single factor",
    "accuracy_percent": None,
    "columns": (),
}


def _dataset(row: Mapping[str, Any]) -> tuple[str, ...]:
    """The main cells of a data set; the others are in the JSON."""
    columns = ("year", "num_scenes", "duration_h", "num_annotated_frames", "boxes_3d")
    marked = (_mark(row, column) for column in (*columns, "conditions", "traffic"))
    return row["name"], *marked


def _mark(row: Mapping[str, Any], column: str) -> str:
    """A cell, with a star if the paper prints something else."""
    is_corrected = any(one["column"] == column for one in row["corrections"])
    return cell(row[column]) + ("*" if is_corrected else "")


def cell(value: object) -> str:
    """A value in words."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return _short(value)
    if isinstance(value, float):
        return f"{value:,.3g}" if value < 1000 else f"{value:,.0f}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(str(one).replace("_", " ") for one in value) or "–"
    return str(value)


def _short(value: int) -> str:
    """A count as the paper writes it; years and small counts stand as they are."""
    for unit, size in (("M", 1_000_000), ("k", 1000)):
        if value >= size and value >= 10_000:
            return f"{value / size:.3g}{unit}"
    return str(value)


def _drawn(
    header: Sequence[str], rows: Sequence[Sequence[str]], found: Mapping[str, Any]
) -> "Group":
    """The table, and below it corrections, doubts and remarks."""
    from rich.console import Group
    from rich.text import Text

    from overtaking.cli.tables import drawn_rows

    table = drawn_rows(header, rows)
    return Group(table, Text("\n".join(_notes(found["rows"]))))


def _notes(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Corrections, doubts and remarks, a line each."""
    notes: list[str] = []
    for row in rows:
        notes += [
            f"* {row['name']}, {one['column']}: {cell(one['value'])}; the paper prints "
            f"{cell(one['printed'])}. {one['why']} [{one['source']}]."
            for one in row.get("corrections", ())
        ]
        notes += [f"? {row['name']}: {text}." for text in row.get("doubts", ())]
        notes += [f"! {row['name']}: {row['remark']}."] if row.get("remark") else []
    return notes
