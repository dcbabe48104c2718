"""The words that commands take, each declared once, and how a command is declared."""

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from overtaking.cli.failures import tell
from overtaking.cli.output import Output

Body = Callable[..., int | None]
"""A command: an `Output`, then what it takes from the command line; returns the exit status."""

Quiet = Annotated[
    bool,
    typer.Option(
        "--quiet",
        "-q",
        help="Print the result only: no progress, no remarks, no summary of written files.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
Log = Annotated[
    Path | None,
    typer.Option("--log", metavar="FILE", help="Append a log to FILE, one JSON object per line."),
]

Data = Annotated[
    str, typer.Argument(metavar="DATA", help="Data set: its folder, or its URL in a store.")
]
Number = Annotated[int, typer.Argument(metavar="N", help="Number of the simulation, from 0.")]

OUT = "Where to write."
OutFolder = Annotated[Path, typer.Option("--out", metavar="FOLDER", help=f"{OUT} A folder.")]
OutPlace = Annotated[
    str,
    typer.Option(
        "--out", metavar="FOLDER|URL", help=f"{OUT} A folder, or a URL such as s3://bucket/data."
    ),
]
OutFile = Annotated[
    Path,
    typer.Option(
        "--out",
        metavar="FILE|FOLDER",
        help=f"{OUT} A file for pinto2023 (.csv or .parquet is added), a folder for the others.",
    ),
]
CheckedFolder = Annotated[
    Path, typer.Option("--out", metavar="FOLDER", help=f"{OUT} The folder whose disk is checked.")
]

PROFILE = "Profile of the package, or a TOML file."
_DEFAULT_PROFILE = f"{PROFILE}  [default: pinto2023]"
Profile = Annotated[
    str | None, typer.Option("--profile", metavar="NAME|FILE", help=_DEFAULT_PROFILE)
]
ProfileWord = Annotated[str | None, typer.Argument(metavar="PROFILE", help=_DEFAULT_PROFILE)]
Others = Annotated[
    str,
    typer.Option(
        "--with",
        metavar="NAME[,NAME]",
        help="Simulators to compare with ours, separated by commas: sumo, carla.",
    ),
]
COUNT = "How many simulations."
Count = Annotated[
    int | None, typer.Option("--count", "-n", metavar="N", help=f"{COUNT}  [default: 276]")
]
SEED = "Seed of the random numbers."
Seed = Annotated[int | None, typer.Option("--seed", metavar="N", help=f"{SEED}  [default: 1]")]
MAP = "OpenDRIVE file, or the name of a road of the package."
Map = Annotated[str | None, typer.Option("--map", metavar="FILE|NAME", help=MAP)]
Road = Annotated[
    str | None,
    typer.Option(
        "--road",
        metavar="ID|NAME",
        help="Id of a road of --map; without --map the name of a road of the package.",
    ),
]
Keep = Annotated[
    str | None,
    typer.Option(
        "--keep",
        metavar="frames|features",
        help="Tables to write. frames: all. features: all but those with a row per frame, which "
        "are simulated again on demand.  [default: frames]",
    ),
]
Resume = Annotated[
    bool, typer.Option("--resume", help="Complete an interrupted data set; --out is enough.")
]
Yes = Annotated[
    bool,
    typer.Option("--yes", help="Make more than 10 GB or 1000000 simulations without a question."),
]
Threads = Annotated[
    int | None,
    typer.Option(
        "--threads", min=1, metavar="N", help="Threads to compute with.  [default: one per core]"
    ),
]
Engine = Annotated[
    str,
    typer.Option(
        "--engine",
        metavar="auto|threads|processes|ray",
        help="Where to compute: threads of this process, processes on this machine, or a Ray "
        "cluster; auto takes processes for large data sets.",
    ),
]
Address = Annotated[
    str | None,
    typer.Option(
        "--address",
        metavar="HOST:PORT",
        help="Address of a running Ray cluster.  [default: start one on this machine]",
    ),
]
Workers = Annotated[
    int | None,
    typer.Option(
        "--workers",
        min=1,
        metavar="N",
        help="Worker processes on this machine.  [default: one per core]",
    ),
]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a value of the profile, such as traffic.vehicles=2..6. Repeatable.",
    ),
]
FrameInterval = Annotated[
    int | None,
    typer.Option(
        "--frame-interval-ms",
        "--frame-interval",
        metavar="MS",
        help="Time between two frames [ms], a multiple of 10.  [default: the profile's]",
    ),
]
Balance = Annotated[
    bool,
    typer.Option("--balance", help="Generate equal numbers of each of the study's five classes."),
]
BalanceBy = Annotated[
    str | None,
    typer.Option(
        "--balance-by",
        metavar="class|class,day-night",
        help="With --balance: what to balance.  [default: class]",
    ),
]
BalanceCandidates = Annotated[
    int | None,
    typer.Option(
        "--balance-candidates",
        metavar="N",
        help="With --balance: simulations to try before a class counts as too rare.  "
        "[default: 200 per wanted simulation, at least 10000]",
    ),
]
AllowMissing = Annotated[
    bool,
    typer.Option(
        "--allow-missing",
        help="With --balance: write the data set even if a class is too rare.",
    ),
]
_POLICY = "Policy that decides on the class: paper, default or strict."
Policy = Annotated[str, typer.Option("--policy", metavar="NAME", help=_POLICY)]
OpenPolicy = Annotated[
    str | None,
    typer.Option("--policy", metavar="NAME", help=f"{_POLICY}  [default: paper]"),
]
FORMAT = "Format of the output."
Format = Annotated[
    str,
    typer.Option(
        "--format",
        metavar="NAME",
        help=f"{FORMAT} pinto2023: the study's table; commonroad, highd: a folder of recordings; "
        "asp, prolog: a folder of facts; popper: input of that learner.",
    ),
]
TARGET = "Target to learn."
AboutTarget = Annotated[
    str | None,
    typer.Option(
        "--about",
        metavar="NAME",
        help=f"{TARGET} With popper: legal, collision, or start (do not start now).  "
        "[default: legal]",
    ),
]
IsCsv = Annotated[
    bool | None,
    typer.Option("--csv/--parquet", help="Kind of file.  [default: by its name, else CSV]"),
]
SIMULATIONS = "Numbers of simulations, such as 1,7,20-29."
ChosenSimulations = Annotated[
    str | None,
    typer.Option("--simulations", metavar="LIST", help=f"{SIMULATIONS}  [default: all]"),
]
ChosenClass = Annotated[
    str | None,
    typer.Option("--class", metavar="NAME", help="Only simulations of a class, such as Success_I."),
]
EveryFrames = Annotated[
    int | None,
    typer.Option(
        "--every",
        min=1,
        metavar="N",
        help="Positions every N frames, and wherever something changes.  [default: 10]",
    ),
]
WithLaw = Annotated[
    bool,
    typer.Option("--law", help="With asp, prolog: add the facts that the law needs, and the law."),
]
ROWS = "Rows to return at most."
TIMEOUT = "Time for the query [s]."
MEMORY = "Memory for the query [MiB]."

RENAMED = {"count": ("--simulations", "--count", int), "own": ("--with", "--own", str)}
"""Options that had another name: parameter, old and new name, and type. For one release."""

_EVERY_COMMAND = [
    inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
    for name, default, annotation in (
        ("quiet", False, Quiet),
        ("json", False, Json),
        ("log", None, Log),
    )
]


def command(app: typer.Typer, body: Body, example: str, group: str = "") -> None:
    """Add a command to an application.

    On the command line, the options that every command has take the place of its `Output`.

    Args:
        app: What the command is added to.
        body: The command; its name and its docstring are those on the command line.
        example: A command line to show below its help.
        group: The word before its name, if it is one of a group.
    """
    own = list(inspect.signature(body).parameters.values())[1:]
    old = [_old(one.name) for one in own if one.name in RENAMED]
    parameters = [*own, *old, *_EVERY_COMMAND]
    name = body.__name__

    @functools.wraps(body)
    def run(*, quiet: bool, json: bool, log: Path | None, **arguments: Any) -> int | None:
        try:
            with Output(f"{group} {name}".strip(), quiet=quiet, json=json, log=log) as output:
                return body(output, **_renamed(output, arguments))
        except (Exception, KeyboardInterrupt) as error:
            return tell(error)  # Before typer sees it, which has its own idea of Ctrl-C.

    setattr(run, "__signature__", inspect.Signature(parameters))  # noqa: B010
    run.__annotations__ = {one.name: one.annotation for one in parameters}
    app.command(name, epilog=f"\b\nExample:\n  {example}")(run)


def _old(name: str) -> inspect.Parameter:
    """The hidden option that a parameter had before."""
    old, _, kind = RENAMED[name]
    return inspect.Parameter(
        f"old_{name}",
        inspect.Parameter.KEYWORD_ONLY,
        default=None,
        annotation=Annotated[kind | None, typer.Option(old, hidden=True)],
    )


def _renamed(output: Output, arguments: dict[str, Any]) -> dict[str, Any]:
    """The arguments with those of old options under their new names."""
    for name, (old, new, _) in RENAMED.items():
        value = arguments.pop(f"old_{name}", None)
        if value is not None:
            output.say(f"warning: {old} is called {new} here; the old name will be removed")
            arguments[name] = value
    return arguments
