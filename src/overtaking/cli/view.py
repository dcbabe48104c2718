"""A page that shows simulations in a browser."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from overtaking.cli import options
from overtaking.cli.output import Output
from overtaking.cli.video import choice
from overtaking.core.words import counted

if TYPE_CHECKING:
    from overtaking.show.view.write import ViewPage

Page = Annotated[Path, options.option("--export FILE", f"{options.OUT} One HTML file.")]
_BYTES_PER_KB, _KB_PER_MB = 1e3, 1e3


def view(
    output: Output,
    data: options.Data,
    export: Page,
    shown: options.Shown,
) -> None:
    """Write simulations as a page to look at in a browser.

    The page is one file: it opens from disk and needs no network.
    """
    from overtaking import api

    with output.progress("simulations") as meter:
        page = api.write_view(
            data,
            export,
            simulations=choice(shown, "view"),
            policy=shown.policy or "paper",
            progress=meter,
            say=lambda size: output.say(f"the page takes {_amount(size)}: {export}"),
        )
    output.wrote(values_of(page), lambda _: _line(page))


def values_of(page: "ViewPage") -> dict[str, Any]:
    """The written file, for machines."""
    return {
        "file": str(page.path),
        "simulations": list(page.simulations),
        "size_bytes": page.size_bytes,
    }


def _line(page: "ViewPage") -> str:
    """The written file, for people."""
    what = counted(len(page.simulations), "simulation")
    return f"{page.path}  {what}, {_amount(page.size_bytes)}"


def _amount(size: int) -> str:
    kilobytes = size / _BYTES_PER_KB
    return f"{kilobytes / _KB_PER_MB:.1f} MB" if kilobytes >= _KB_PER_MB else f"{kilobytes:.0f} kB"
