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

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing but errors.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON, for machines.")]
Log = Annotated[
    Path | None,
    typer.Option("--log", metavar="FILE", help="Append what happens to FILE, one JSON per line."),
]

Data = Annotated[
    str, typer.Argument(metavar="DATA", help="Folder of a data set, or its URL in a store.")
]
Number = Annotated[int, typer.Argument(metavar="N", help="Number of a simulation, from 0.")]
OutFolder = Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Folder to write to.")]
OutPlace = Annotated[
    str,
    typer.Option(
        "--out", metavar="FOLDER|URL", help="Where to write: a folder, or s3://bucket/data."
    ),
]
OutFile = Annotated[
    Path,
    typer.Option(
        "--out", metavar="FILE", help="File (.csv or .parquet is added), or folder, to write."
    ),
]
Profile = Annotated[
    str | None,
    typer.Option(
        "--profile",
        metavar="NAME|FILE",
        help="Profile of the package, or a TOML file of your own.  [default: pinto2023]",
    ),
]
ProfileWord = Annotated[
    str | None,
    typer.Argument(
        metavar="PROFILE",
        help="Profile of the package, or a TOML file of your own.  [default: pinto2023]",
    ),
]
Others = Annotated[
    str,
    typer.Option(
        "--with", metavar="NAME[,NAME]", help="Simulators to compare ours with: sumo, carla."
    ),
]
Simulations = Annotated[
    int | None, typer.Option("--simulations", "-n", metavar="N", help="How many.  [default: 276]")
]
Seed = Annotated[
    int | None, typer.Option("--seed", metavar="N", help="Of all random numbers.  [default: 1]")
]
Map = Annotated[
    Path | None, typer.Option("--map", metavar="FILE", help="OpenDRIVE file with the road to use.")
]
Road = Annotated[
    str | None,
    typer.Option("--road", metavar="ID|NAME", help="Road of that file, or one of the package."),
]
Keep = Annotated[
    str | None,
    typer.Option(
        "--keep",
        metavar="frames|features",
        help="Write everything, or leave out what has a row per frame and simulate it again when "
        "it is asked for.  [default: frames]",
    ),
]
Resume = Annotated[
    bool, typer.Option("--resume", help="Complete what was begun; --out alone is enough.")
]
Yes = Annotated[
    bool,
    typer.Option("--yes", help="Make more than 10 GB or 1000000 simulations without a question."),
]
Threads = Annotated[
    int | None,
    typer.Option("--threads", min=1, metavar="N", help="Threads to compute with.  [default: all]"),
]
Engine = Annotated[
    str,
    typer.Option(
        "--engine",
        metavar="auto|threads|processes|ray",
        help="Work with the threads of this process, with processes of this machine or with those "
        "of a Ray cluster; auto takes processes for much work.",
    ),
]
Address = Annotated[
    str | None,
    typer.Option(
        "--address",
        metavar="HOST:PORT",
        help="A Ray cluster that runs.  [default: one on this machine, for this command]",
    ),
]
Workers = Annotated[
    int | None,
    typer.Option(
        "--workers",
        min=1,
        metavar="N",
        help="Processes on this machine.  [default: one on each core]",
    ),
]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Change the profile, such as traffic.vehicles=2..6."
    ),
]
FrameInterval = Annotated[
    int | None,
    typer.Option(
        "--frame-interval-ms",
        "--frame-interval",
        metavar="MS",
        help="Time between two frames, a multiple of 10.  [default: the profile's]",
    ),
]
Balance = Annotated[
    bool,
    typer.Option("--balance", help="Make equal numbers of each of the paper's five classes."),
]
BalanceBy = Annotated[
    str | None,
    typer.Option(
        "--balance-by",
        metavar="class|class,day-night",
        help="What gets equal numbers with --balance.  [default: class]",
    ),
]
BalancePolicy = Annotated[
    str | None,
    typer.Option(
        "--policy",
        metavar="NAME",
        help="Which rules decide about the class with --balance: paper, default or strict.  "
        "[default: paper]",
    ),
]
BalanceCandidates = Annotated[
    int | None,
    typer.Option(
        "--balance-candidates",
        metavar="N",
        help="Simulations to look through with --balance before a class counts as too rare.  "
        "[default: 200 for each that is wanted, at least 10000]",
    ),
]
AllowMissing = Annotated[
    bool,
    typer.Option(
        "--allow-missing",
        help="Write what there is if a class is too rare for --balance, instead of failing.",
    ),
]
Format = Annotated[
    str,
    typer.Option(
        "--format",
        metavar="NAME",
        help="Whose format: pinto2023 is the paper's table; commonroad and highd are folders; asp "
        "and prolog are folders of facts; popper is what a learner of rules reads.",
    ),
]
AboutTarget = Annotated[
    str | None,
    typer.Option(
        "--about",
        metavar="NAME",
        help="With popper: legal, collision, or start (do not start now).  [default: legal]",
    ),
]
IsCsv = Annotated[
    bool | None,
    typer.Option("--csv/--parquet", help="Kind of file.  [default: by its name, else CSV]"),
]
ChosenSimulations = Annotated[
    str | None,
    typer.Option(
        "--simulations",
        metavar="LIST",
        help="Numbers and ranges of simulations, such as 1,7,20-29.  [default: all]",
    ),
]
ChosenClass = Annotated[
    str | None,
    typer.Option("--class", metavar="NAME", help="Only simulations of a class, as Success_I."),
]
ChosenPolicy = Annotated[
    str | None,
    typer.Option(
        "--policy", metavar="NAME", help="Whose class: paper, default or strict.  [default: paper]"
    ),
]
EveryFrames = Annotated[
    int | None,
    typer.Option(
        "--every",
        min=1,
        metavar="N",
        help="Facts about positions every N frames, beside those where something changes.  "
        "[default: 10]",
    ),
]
WithLaw = Annotated[
    bool, typer.Option("--law", help="Facts that the law reads, in every frame, and the law.")
]
Folder = Annotated[
    Path, typer.Option("--out", metavar="FOLDER", help="Where data would be written.")
]

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
    parameters = [*own, *_EVERY_COMMAND]
    name = body.__name__

    @functools.wraps(body)
    def run(*, quiet: bool, json: bool, log: Path | None, **arguments: Any) -> int | None:
        try:
            with Output(f"{group} {name}".strip(), quiet=quiet, json=json, log=log) as output:
                return body(output, **arguments)
        except (Exception, KeyboardInterrupt) as error:
            return tell(error)  # Before typer sees it, which has its own idea of Ctrl-C.

    setattr(run, "__signature__", inspect.Signature(parameters))  # noqa: B010
    run.__annotations__ = {one.name: one.annotation for one in parameters}
    app.command(name, epilog=f"\b\nExample:\n  {example}")(run)
