"""The commands. Heavy libraries are imported by the command that needs them, not here."""

from pathlib import Path
from typing import Annotated

import typer

from overtaking.cli import (
    carla,
    driving,
    evaluating,
    film,
    glossary,
    importing,
    labelling,
    laws,
    learn,
    literature,
    logic,
    options,
    reproducing,
    roads,
    sql,
    stats,
    sumo,
    validate,
    view,
    whatif,
)
from overtaking.cli.help import HelpGroup
from overtaking.cli.output import Output

HELP = "Simulate, label and explain overtaking manoeuvres."


def build() -> typer.Typer:
    """The application with all its commands."""
    app = _typer(HELP, add_completion=True)
    app.callback()(_overtaking)
    for body, example in COMMANDS.items():
        options.command(app, body, example)
    for name, (about, commands) in GROUPS.items():
        group = _typer(about)
        group.callback()(_group)  # Without it, a group of one command would be that command.
        for body, example in commands.items():
            options.command(group, body, example, name)
        app.add_typer(group, name=name)
    return app


def _typer(about: str, *, add_completion: bool = False) -> typer.Typer:
    return typer.Typer(
        cls=HelpGroup,
        help=about,
        add_completion=add_completion,
        rich_markup_mode=None,  # Plain help is there at once and reads well everywhere.
        context_settings={"help_option_names": ["-h", "--help"]},
    )


def _group() -> None:
    """Declare what belongs to no command of a group."""


def _print_version(is_wanted: bool) -> None:
    """Print the version and leave."""
    if is_wanted:
        from importlib.metadata import version

        print(version("overtaking"))
        raise typer.Exit


def _overtaking(
    version: Annotated[
        bool,
        options.option("--version", "Print the version.", is_eager=True, callback=_print_version),
    ] = False,
) -> None:
    """Declare what belongs to no command."""


def generate(
    output: Output,
    out: options.OutPlace,
    made: options.Making,
    balanced: options.Balancing,
    road: options.RoadChoice,
    profile_word: options.ProfileWord = None,
    profile: options.Profile = None,
    threads: options.Threads = None,
    executor: options.Executor = "auto",
    address: options.Address = None,
    workers: options.Workers = None,
) -> None:
    """Simulate scenarios of a profile and write a labelled data set."""
    from overtaking.cli import arguments, making

    arguments.limit_threads(threads)
    recipe = making.recipe(made, making.choose_profile(profile_word, profile), road)
    recipe |= arguments.given(balance=making.balance(balanced))
    execution = {"executor": executor, "address": address, "workers": workers}
    making.make(output, out, recipe, made, execution=execution)


def show(
    output: Output,
    data: options.Data,
    simulation: options.Number,
    error_options: options.MeasurementErrorOptions,
) -> None:
    """Show one simulation in the terminal: events, beliefs, law.

    Each broken rule comes with what would have been legal.
    """
    from overtaking.api import datasets, simulating
    from overtaking.cli import arguments, show
    from overtaking.show import description

    errors = arguments.measurement_errors(error_options)
    labelled = simulating.label(datasets.load_dataset(data).trajectory(simulation), errors=errors)
    values = description.describe(labelled, simulation)
    output.result(values, lambda console: show.render(labelled.trajectories, values, console))


def info(output: Output, data: options.Data) -> None:
    """Print what a data set contains and how it was made."""
    from overtaking.api import datasets
    from overtaking.cli import summary

    values = summary.of_dataset(datasets.load_dataset(data))
    output.result(values, lambda _: summary.render(values))


def export(
    output: Output,
    data: options.Data,
    out: options.OutFile,
    chosen: options.Chosen,
    file_format: options.Format = "pinto2023",
    is_csv: options.IsCsv = None,
    with_law: options.WithLaw = False,
    about: options.AboutTarget = None,
) -> None:
    """Convert a data set to the format of another program or paper."""
    from overtaking.api import file_formats
    from overtaking.cli import arguments, summary

    target = arguments.export_target(out, file_format, is_csv=is_csv)
    given = arguments.chosen(chosen, "export")
    given |= arguments.given(with_law=with_law or None, about=about)
    with output.progress("simulations") as meter:
        rows = file_formats.export_dataset(
            data, target, file_format=file_format, progress=meter, **given
        )
    values = summary.of_table(target, rows)
    output.wrote(values, lambda _: summary.render_table(values))


def compare(
    output: Output,
    road: options.RoadChoice,
    profile: options.ProfileWord = None,
    num_simulations: options.NumSimulations = None,
    seed: options.Seed = None,
    others: options.Others = "sumo",
    threads: options.Threads = None,
    changes: options.Changes = None,
) -> None:
    """Run the same scenarios on several simulators and compare.

    Prints the classes on each simulator, and when and where the trajectories diverge.
    """
    from overtaking.api import studies
    from overtaking.cli import arguments, comparison

    arguments.limit_threads(threads)
    chosen = ("engine", *(name.strip() for name in others.split(",")))
    recipe = arguments.DEFAULTS | arguments.given(
        profile=profile,
        num_simulations=num_simulations,
        seed=seed,
        road=arguments.road(road),
        overrides=arguments.overrides(changes or [], None),
    )
    with output.progress("simulations") as meter:
        found = studies.compare_simulators(simulators=chosen, progress=meter, **recipe)
    values = comparison.values_of(found)
    output.result(values, lambda _: comparison.render(values))


def doctor(output: Output, folder: options.CheckedFolder = Path()) -> int:
    """Check the installation.

    Each missing extra comes with the command that installs it. The exit status is 1 if something
    keeps the package from working.
    """
    from overtaking.cli import doctor

    values = doctor.diagnose(folder)
    output.result(values, lambda console: doctor.render(values, console))
    return 1 if values["findings"] else 0


COMMANDS: dict[options.Body, str] = {
    generate: "overtaking generate pinto2023-physical -n 276 --seed 1 --out data/pinto",
    driving.drive: "overtaking drive motorway --driver my_driver.py:keep_gap --observation human "
    "-n 100 --out data/mine",
    evaluating.evaluate: "overtaking evaluate motorway --driver rules --references human,stay "
    "-n 200 --out page",
    show: "overtaking show data/pinto 17",
    info: "overtaking info data/pinto",
    importing.import_recording: "overtaking import commonroad scene.xml --out data/scene",
    labelling.label: "overtaking label data/scene --position-std 0.5",
    export: "overtaking export data/pinto --format pinto2023 --out table.csv",
    stats.stats: "overtaking stats data/pinto --format latex",
    stats.report: "overtaking report data/pinto",
    sql.sql: 'overtaking sql data/pinto "select class, count(*) from labels '
    "where policy = 'paper' group by class\"",
    sql.er: "overtaking er --format mermaid",
    logic.ask: 'overtaking ask data/pinto "overtakes(S,ego,P,F), night(S), illegal(S,l3)"',
    film.film: "overtaking film data/pinto --simulations 1,7",
    view.view: "overtaking view data/pinto",
    whatif.twin: "overtaking twin data/pinto 3 --without rain --film twin.mp4",
    whatif.fan: "overtaking fan data/pinto 3 --condition-on belief --plot fan.png",
    whatif.enough: "overtaking enough data/pinto 3 --goal lawful",
    validate.validate: "overtaking validate motorway -n 1000 --seed 1 --plot motorway.png",
    reproducing.reproduce: "overtaking reproduce pinto2023 --num-replicates 100 --out reproduction",
    compare: "overtaking compare pinto2023-physical -n 100 --seed 1 --with sumo,carla",
    roads.roads: "overtaking roads town.xodr --plot town.png",
    glossary.glossary: "overtaking glossary Success_I",
    doctor: "overtaking doctor --json",
}
"""The commands, each with an example, in the order of the help."""

GROUPS: dict[str, tuple[str, dict[options.Body, str]]] = {
    "carla": (
        "Run scenarios on CARLA 0.9.16, or serve CARLA's clients.",
        {
            carla.serve: "overtaking carla serve --port 2000",
            carla.run: "overtaking carla run motorway -n 20 --driver own --out data/carla",
            carla.replay: "overtaking carla replay data/pinto --simulations 1,7 --out films",
            carla.limits: "overtaking carla limits",
        },
    ),
    "law": (
        "Judge by laws, policies and tolerances.",
        {
            laws.curve: "overtaking law curve data/pinto --policy default --plot law.png",
            laws.compare: "overtaking law compare data/pinto --law pt,de",
            laws.explain: "overtaking law explain data/pinto 17 --rules L3,L12",
        },
    ),
    "learn": (
        "Learn rules and factors from a data set.",
        {
            learn.rules: "overtaking learn rules data/pinto --about start",
            learn.factors: "overtaking learn factors data/pinto --repeats 3 --show-leakage",
        },
    ),
    "literature": (
        "List what the study surveys, with corrections.",
        {
            literature.systems: "overtaking literature systems",
            literature.datasets: "overtaking literature datasets --night --rain --boxes3d",
            literature.factors: "overtaking literature factors --json",
            literature.studies: "overtaking literature studies",
        },
    ),
    "sumo": (
        "Run scenarios on Eclipse SUMO.",
        {sumo.run: "overtaking sumo run pinto2023-physical -n 20 --seed 1 --out data/sumo"},
    ),
}
"""Commands of two words."""
