"""Simulations in a browser: a server for a data set, or a page in a file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from overtaking.cli import options
from overtaking.cli.film import choice
from overtaking.cli.output import Output
from overtaking.core.errors import ConfigError
from overtaking.core.representation import format_count

if TYPE_CHECKING:
    from overtaking.show.view.write import ViewPage

Page = Annotated[
    Path | None,
    options.option("--export FILE", f"{options.OUT} One HTML file, in place of a server."),
]
Port = Annotated[
    int,
    options.option(
        "--port P", f"{options.PORT} Of this machine only.  [default: any]", min=0, max=65535
    ),
]
Open = Annotated[bool, options.option("--open", "Open the page in the browser of this system.")]
_BYTES_PER_KB, _KB_PER_MB = 1e3, 1e3


def view(
    output: Output,
    data: options.Data,
    shown: options.Shown,
    export: Page = None,
    port: Port = 0,
    opens: Open = False,
) -> None:
    """Look at a data set in a browser, or write a page of it.

    Without --export a server on this machine shows all simulations until Ctrl-C. With it the page
    is one file: it opens from disk and needs no network.
    """
    if export is None:
        _serve(output, data, shown, port, opens=opens)
    else:
        _write(output, data, shown, export)


def _serve(output: Output, data: str, shown: options.Shown, port: int, *, opens: bool) -> None:
    import webbrowser

    from overtaking.api import reports

    if shown.simulation_ids is not None or shown.one_per_class or shown.every:
        raise ConfigError(
            what="choice",
            where="view",
            expected="--export FILE with it",
            got="a server, which shows every simulation",
            next_step="add --export, or leave the choice out",
        )

    def ready(url: str) -> None:
        output.result({"url": url}, lambda _: f"open {url}\nCtrl-C ends")
        if opens:
            webbrowser.open(url)

    reports.serve_viewer(data, policy=shown.policy, port=port, ready=ready)


def _write(output: Output, data: str, shown: options.Shown, export: Path) -> None:
    from overtaking.api import reports

    with output.progress("simulations") as meter:
        page = reports.write_viewer_page(
            data,
            export,
            simulation_ids=choice(shown, "view"),
            policy=shown.policy,
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
    what = format_count(len(page.simulations), "simulation")
    return f"{page.path}  {what}, {_amount(page.size_bytes)}"


def _amount(size: int) -> str:
    kilobytes = size / _BYTES_PER_KB
    return f"{kilobytes / _KB_PER_MB:.1f} MB" if kilobytes >= _KB_PER_MB else f"{kilobytes:.0f} kB"
