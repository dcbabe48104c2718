"""Films of simulations."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from overtaking.cli import arguments, options
from overtaking.cli.output import Output
from overtaking.core.errors import ConfigError
from overtaking.core.representation import format_count

if TYPE_CHECKING:
    from overtaking.cli.tables import FittingTable
    from overtaking.show.video.produce import Video

Folder = Annotated[
    Path | None, options.option("--out FOLDER", f"{options.OUT} A folder.  [default: DATA/films]")
]

_MOST_LISTED = 12
_BYTES_PER_MB = 1e6


def film(
    output: Output,
    data: options.Data,
    shown: options.Shown,
    out: Folder = None,
    threads: options.Threads = None,
) -> None:
    """Render simulations as mp4 films, seen from above."""
    from overtaking.api import reports

    with output.progress("films") as meter:
        films = reports.film(
            data,
            out,
            simulation_ids=choice(shown, "film"),
            policy=shown.policy,
            threads=threads,
            progress=meter,
        )
    values = values_of(films) | output.duration
    output.wrote(values, lambda _: render(values))


def choice(shown: options.Shown, where: str) -> list[int] | str:
    """The selected simulations, as an argument of `film`.

    Args:
        shown: The options.
        where: The command.

    Raises:
        ConfigError: More than one of these, or an invalid number.
    """
    if (shown.simulation_ids is not None) + shown.one_per_class + shown.every > 1:
        raise ConfigError(
            what="choice",
            where=where,
            expected="one of --simulations, --one-per-class and --all",
            got="several",
            next_step="leave out the others",
        )
    numbers = arguments.numbers(shown.simulation_ids, where)
    return numbers or ("all" if shown.every else "one-per-class")


def values_of(films: "list[Video]") -> dict[str, Any]:
    """Summary of the films as plain values."""
    return {
        "films": [
            {
                "simulation": film.number,
                "class": film.label,
                "file": str(film.path),
                "frames": film.num_frames,
                "duration_s": film.duration,
                "width_px": film.size[0],
                "height_px": film.size[1],
                "size_bytes": film.path.stat().st_size,
            }
            for film in films
        ],
    }


def render(values: dict[str, Any]) -> "FittingTable":
    """Summary of the films as a table."""
    from overtaking.cli.tables import open_table

    films = values["films"]
    table = open_table("", "", "", "")
    for film in films[:_MOST_LISTED]:
        size = film["size_bytes"] / _BYTES_PER_MB
        length = f"{film['duration_s']:.1f} s"
        table.add_row(film["file"], film["class"], length, f"{size:.1f} MB")
    if len(films) > _MOST_LISTED:
        table.add_row(f"and {len(films) - _MOST_LISTED} more in the same folder")
    seconds = values["duration_s"]
    rate = len(films) / max(seconds, 1e-3)
    made = f"{format_count(len(films), 'film')} in {seconds:.1f} s, {rate:.1f}/s"
    table.add_row(made)
    return table
