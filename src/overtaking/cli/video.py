"""Films of simulations."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from overtaking.cli import arguments, options
from overtaking.cli.output import Output
from overtaking.cli.tables import open_table
from overtaking.core.errors import ConfigError
from overtaking.core.words import counted

if TYPE_CHECKING:
    from rich.table import Table

    from overtaking.show.video.produce import Video

Chosen = Annotated[str | None, options.option("--simulations LIST", options.SIMULATIONS)]
PerClass = Annotated[
    bool, options.option("--one-per-class", "The first simulation of each class; the default.")
]
All = Annotated[bool, options.option("--all", "Every simulation.")]
Folder = Annotated[
    Path | None, options.option("--out FOLDER", f"{options.OUT} A folder.  [default: DATA/videos]")
]

_MOST_LISTED = 12
_BYTES_PER_MB = 1e6


def video(
    output: Output,
    data: options.Data,
    simulations: Chosen = None,
    one_per_class: PerClass = False,
    every: All = False,
    policy: options.OpenPolicy = None,
    out: Folder = None,
    threads: options.Threads = None,
) -> None:
    """Render simulations as mp4 films, seen from above."""
    from overtaking import api

    chosen = choice(simulations, is_per_class=one_per_class, is_every=every)
    with output.progress("films") as meter:
        films = api.film(
            data,
            out,
            simulations=chosen,
            policy=policy or "paper",
            threads=threads,
            progress=meter,
        )
    values = values_of(films) | output.duration
    output.wrote(values, lambda _: render(values))


def choice(
    text: str | None, where: str = "video", *, is_per_class: bool, is_every: bool
) -> list[int] | str:
    """What was asked for, as `api.film` takes it.

    Args:
        text: Numbers and ranges with commas between them, if there are any.
        where: The command.
        is_per_class: Whether one of each class was asked for.
        is_every: Whether all were asked for.

    Raises:
        ConfigError: More than one of these, or what is no number.
    """
    if (text is not None) + is_per_class + is_every > 1:
        raise ConfigError.of(
            what="choice",
            where=where,
            expected="one of --simulations, --one-per-class and --all",
            got="several",
            next_step="leave out the others",
        )
    if text is None:
        return "all" if is_every else "one-per-class"
    return arguments.numbers(text, where) or []


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


def render(values: dict[str, Any]) -> "Table":
    """Summary of the films as a table."""
    films = values["films"]
    table = open_table(show_header=False)
    for film in films[:_MOST_LISTED]:
        size = film["size_bytes"] / _BYTES_PER_MB
        length = f"{film['duration_s']:.1f} s"
        table.add_row(film["file"], film["class"], length, f"{size:.1f} MB")
    if len(films) > _MOST_LISTED:
        table.add_row(f"and {len(films) - _MOST_LISTED} more in the same folder", "", "", "")
    seconds = values["duration_s"]
    rate = len(films) / max(seconds, 1e-3)
    made = f"{counted(len(films), 'film')} in {seconds:.1f} s, {rate:.1f}/s"
    table.add_row(made, "", "", "")
    return table
