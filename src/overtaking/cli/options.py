"""The words that commands take, each declared once, and how a command is declared."""

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any
from warnings import catch_warnings, simplefilter

import typer

from overtaking.cli.failures import tell
from overtaking.cli.help import EXAMPLE, HelpCommand
from overtaking.cli.output import Output
from overtaking.core.errors import RecordingWarning
from overtaking.core.process_limits import check_address_space

Body = Callable[..., int | None]
"""A command: an `Output`, then what it takes from the command line; returns the exit status.

A dataclass among its parameters is a group of options: each field is one.
"""


def option(words: str, about: str, **settings: Any) -> Any:
    """An option.

    Args:
        words: Its names, and the word for its value if it takes one, such as `--seed N`.
        about: What it means.
        settings: Further settings of `typer.Option`.
    """
    names = [word for word in words.split() if word.startswith("-")]
    metavar = " ".join(word for word in words.split() if word not in names) or None
    return typer.Option(*names, metavar=metavar, help=about, **settings)


Quiet = Annotated[
    bool,
    option(
        "--quiet -q", "Print the result only: no progress, no remarks, no summary of written files."
    ),
]
Json = Annotated[bool, option("--json", "Print the result as JSON.")]
Log = Annotated[
    Path | None, option("--log FILE", "Append a log to FILE, one JSON object per line.")
]


@dataclass(frozen=True, kw_only=True)
class _Common:
    """The options of every command."""

    quiet: Quiet = False
    json: Json = False
    log: Log = None


Data = Annotated[
    str, typer.Argument(metavar="DATA", help="Data set: its folder, or its URL in a store.")
]
Number = Annotated[int, typer.Argument(metavar="N", help="Number of the simulation, from 0.")]

PositionStd = Annotated[
    float | None,
    option(
        "--position-std M",
        "Standard deviation of recorded positions [m]. A margin of less than two standard errors "
        "is undecidable.  [default: 0]",
    ),
]
SpeedStd = Annotated[
    float | None,
    option("--speed-std MPS", "Standard deviation of recorded speeds [m/s].  [default: 0]"),
]


@dataclass(frozen=True, kw_only=True)
class MeasurementErrorOptions:
    """The options for errors of measurement."""

    position_std: PositionStd = None
    speed_std: SpeedStd = None


OUT = "Where to write."
PORT = "Port to listen on."
OutFolder = Annotated[Path, option("--out FOLDER", f"{OUT} A folder.")]
OutPlace = Annotated[
    str, option("--out FOLDER|URL", f"{OUT} A folder, or a URL such as s3://bucket/data.")
]
OutFile = Annotated[
    Path,
    option(
        "--out FILE|FOLDER",
        f"{OUT} A file for pinto2023 (.csv or .parquet is added), a folder for the others.",
    ),
]
CheckedFolder = Annotated[Path, option("--out FOLDER", f"{OUT} The folder whose disk is checked.")]

PROFILE = "Profile of the package, or a TOML file."
_DEFAULT_PROFILE = f"{PROFILE}  [default: pinto2023-physical]"
Profile = Annotated[str | None, option("--profile NAME|FILE", _DEFAULT_PROFILE)]
ProfileWord = Annotated[str | None, typer.Argument(metavar="PROFILE", help=_DEFAULT_PROFILE)]
Others = Annotated[
    str,
    option(
        "--with NAME[,NAME]", "Simulators to compare with ours, separated by commas: sumo, carla."
    ),
]
NUM_SIMULATIONS = "Number of simulations."
NumSimulations = Annotated[
    int | None, option("--num-simulations -n N", f"{NUM_SIMULATIONS}  [default: 276]")
]
SEED = "Seed of the random numbers."
Seed = Annotated[int | None, option("--seed N", f"{SEED}  [default: 1]")]
MAP = "OpenDRIVE file, or the name of a road of the package."
Map = Annotated[str | None, option("--map FILE|NAME", MAP)]
Road = Annotated[
    str | None,
    option(
        "--road ID|NAME", "Id of a road of --map; without --map the name of a road of the package."
    ),
]
SpeedLimit = Annotated[
    str | None,
    option(
        "--speed-limit KMH|none",
        "Speed limit of the road, replaces that of the file [km/h]; none: no limit.",
    ),
]
DrivingSide = Annotated[
    str | None,
    option(
        "--driving-side left|right",
        "Side of the road that traffic keeps to, replaces that of the file.",
    ),
]


@dataclass(frozen=True, kw_only=True)
class RoadChoice:
    """The options that choose a road."""

    map_file: Map = None
    road: Road = None
    speed_limit: SpeedLimit = None
    driving_side: DrivingSide = None


Plot = Annotated[
    Path | None, option("--plot FILE", "Draw the figures to a .png, .svg or .pdf file.")
]
Keep = Annotated[
    str | None,
    option(
        "--keep frames|features",
        "Tables to write. frames: all. features: all but those with a row per frame, which "
        "are simulated again on demand.  [default: frames]",
    ),
]
Resume = Annotated[bool, option("--resume", "Complete an interrupted data set; --out is enough.")]
Yes = Annotated[
    bool, option("--yes", "Make more than 10 GB or 1000000 simulations without a question.")
]
Threads = Annotated[
    int | None, option("--threads N", "Threads to compute with.  [default: one per core]", min=1)
]
Executor = Annotated[
    str,
    option(
        "--executor auto|threads|processes|ray",
        "Where to compute: threads of this process, processes on this machine, or a Ray "
        "cluster; auto takes processes for large data sets.",
    ),
]
Address = Annotated[
    str | None,
    option(
        "--address HOST:PORT",
        "Address of a running Ray cluster.  [default: start one on this machine]",
    ),
]
Workers = Annotated[
    int | None,
    option("--workers N", "Worker processes on this machine.  [default: one per core]", min=1),
]
Changes = Annotated[
    list[str] | None,
    option(
        "--set KEY=VALUE",
        "Change a value of the profile, such as traffic.vehicles=2..6. Repeatable.",
    ),
]
FrameInterval = Annotated[
    int | None,
    option(
        "--frame-interval-ms --frame-interval MS",
        "Time between two frames [ms], a multiple of 10.  [default: the profile's]",
    ),
]


@dataclass(frozen=True, kw_only=True)
class Making:
    """The options of every command that makes a data set of simulations."""

    num_simulations: NumSimulations = None
    seed: Seed = None
    keep: Keep = None
    resume: Resume = False
    yes: Yes = False
    changes: Changes = None
    frame_interval_ms: FrameInterval = None


Balance = Annotated[
    bool, option("--balance", "Generate equal numbers of each of the study's five classes.")
]
BalanceBy = Annotated[
    str | None,
    option(
        "--balance-by class|class,day-night", "With --balance: what to balance.  [default: class]"
    ),
]
BalanceCandidates = Annotated[
    int | None,
    option(
        "--balance-candidates N",
        "With --balance: simulations to try before a class counts as too rare.  "
        "[default: 200 per wanted simulation, at least 10000]",
    ),
]
AllowMissing = Annotated[
    bool,
    option("--allow-missing", "With --balance: write the data set even if a class is too rare."),
]
Policy = Annotated[
    str | None,
    option(
        "--policy NAME",
        "Policy that decides on the class: paper, default or strict; law knows serious and "
        "enforced too.  [default: default; paper for pinto2023 and pinto2023-physical]",
    ),
]
_LAW = (
    "Rules to judge by: pt, de, or MODULE:PACK, whose code is executed; several, separated by "
    "commas, where laws are compared. The data set stays as it is."
)
Law = Annotated[str, option("--law NAME|MODULE:PACK", _LAW)]
OpenLaw = Annotated[
    str | None,
    option("--law NAME|MODULE:PACK", f"{_LAW}  [default: pt, written into the data set]"),
]
_POLICIES = "Policies of the law, separated by commas."
Policies = Annotated[str, option("--policies NAME,NAME", _POLICIES)]
OpenPolicies = Annotated[
    str | None, option("--policies NAME,NAME", f"{_POLICIES}  [default: paper,default,strict]")
]


@dataclass(frozen=True, kw_only=True)
class Balancing:
    """The options of a balanced data set."""

    balance: Balance = False
    by: BalanceBy = None
    policy: Policy = None
    candidates: BalanceCandidates = None
    allows_missing: AllowMissing = False


FORMAT = "Format of the output."
Format = Annotated[
    str,
    option(
        "--format NAME",
        f"{FORMAT} pinto2023: the study's table; commonroad, highd: a folder of recordings; "
        "openscenario: scenarios with their roads; asp, prolog: a folder of facts; popper: input "
        "of that learner.",
    ),
]
TARGET = "Target to learn."
AboutTarget = Annotated[
    str | None,
    option(
        "--about NAME",
        f"{TARGET} With popper: legal, collision, or start (do not start now).  [default: legal]",
    ),
]
IsCsv = Annotated[
    bool | None, option("--csv/--parquet", "Kind of file.  [default: by its name, else CSV]")
]
SIMULATIONS = "Numbers of simulations, such as 1,7,20-29."
ChosenSimulations = Annotated[
    str | None, option("--simulations LIST", f"{SIMULATIONS}  [default: all]")
]
ChosenClass = Annotated[
    str | None, option("--class NAME", "Only simulations of a class, such as Success_I.")
]
FrameStep = Annotated[
    int | None,
    option(
        "--frame-step N",
        "Positions every N frames, and wherever something changes.  [default: 10]",
        min=1,
    ),
]


@dataclass(frozen=True, kw_only=True)
class Chosen:
    """The options that choose simulations of a data set, and frames of them."""

    simulation_ids: ChosenSimulations = None
    overtake_class: ChosenClass = None
    policy: Policy = None
    frame_step: FrameStep = None


WithLaw = Annotated[
    bool, option("--with-law", "With asp, prolog: add the facts that the law needs, and the law.")
]


@dataclass(frozen=True, kw_only=True)
class Shown:
    """The options that choose simulations to look at."""

    simulation_ids: Annotated[str | None, option("--simulations LIST", SIMULATIONS)] = None
    one_per_class: Annotated[
        bool,
        option(
            "--one-per-class", "The first simulation of each class that lasts 2 s; the default."
        ),
    ] = False
    every: Annotated[bool, option("--all", "Every simulation.")] = False
    policy: Policy = None


ROWS = "Rows to return at most."
TIMEOUT = "Time for the query [s]."
MEMORY = "Memory for the query [MiB]."


def command(app: typer.Typer, body: Body, example: str, group: str = "") -> None:
    """Add a command to an application.

    On the command line, the options that every command has take the place of its `Output`.

    Args:
        app: What the command is added to.
        body: The command; its name and its docstring are those on the command line.
        example: A command line to show below its help.
        group: The word before its name, if it is one of a group.
    """
    taken = list(inspect.signature(body).parameters.values())[1:]
    groups: dict[str, Any] = {
        one.name: one.annotation for one in taken if is_dataclass(one.annotation)
    }
    own = [each for one in taken for each in _fields(groups.get(one.name)) or (one,)]
    parameters = [one.replace(kind=one.KEYWORD_ONLY) for one in [*own, *_fields(_Common)]]
    name = body.__name__

    @functools.wraps(body)
    def run(*, quiet: bool, json: bool, log: Path | None, **arguments: Any) -> int | None:
        try:
            title = f"{group} {name}".strip()
            check_address_space(title)
            with Output(title, quiet=quiet, json=json, log=log) as output, catch_warnings():
                simplefilter("ignore", RecordingWarning)  # Commands print the report instead.
                for place, kind in groups.items():
                    arguments[place] = kind(
                        **{each.name: arguments.pop(each.name) for each in fields(kind)}
                    )
                return body(output, **arguments)
        except (Exception, KeyboardInterrupt) as error:
            return tell(error)  # Before typer sees it, which has its own idea of Ctrl-C.

    setattr(run, "__signature__", inspect.Signature(parameters))  # noqa: B010
    run.__annotations__ = {one.name: one.annotation for one in parameters}
    app.command(name, cls=HelpCommand, epilog=f"\b\n{EXAMPLE}{example}")(run)


def _fields(group: Any) -> list[inspect.Parameter]:
    """The options of a group as parameters; none without a group."""
    return [_option(one.name, one.default, one.type) for one in (fields(group) if group else ())]


def _option(name: str, default: Any, annotation: Any) -> inspect.Parameter:
    kind = inspect.Parameter.KEYWORD_ONLY
    return inspect.Parameter(name, kind, default=default, annotation=annotation)
