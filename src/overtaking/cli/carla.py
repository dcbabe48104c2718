"""The commands that begin with `overtaking carla`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from overtaking.cli import options
from overtaking.cli.output import Output

if TYPE_CHECKING:
    from rich.console import Group

PORT = 2000

Port = Annotated[
    int,
    options.option("--port P", f"{options.PORT} For calls; P+1 is for streams.", min=0, max=65534),
]
Host = Annotated[
    str,
    options.option(
        "--host ADDRESS", "Address to listen on; the default is reachable from this machine only."
    ),
]
Maps = Annotated[
    list[str] | None,
    options.option(
        "--map FILE|NAME",
        f"{options.MAP} Again for each further one that clients may load.  [default: town06]",
    ),
]


def serve(
    output: Output,
    port: Port = PORT,
    host: Host = "127.0.0.1",
    maps: Maps = None,
    seed: options.Seed = None,
) -> None:
    """Serve clients of CARLA 0.9.16 without CARLA, on our dynamics.

    Needs neither CARLA nor a graphics card.
    """
    from overtaking.api import carla

    places = maps or ["town06"]

    def ready(calls: int, streams: int) -> None:
        values = {"host": host, "port": calls, "stream_port": streams, "maps": places}
        text = f"ready for CARLA 0.9.16 clients on {host}:{calls} (streams {streams}); Ctrl-C ends"
        output.wrote(values, lambda _: text)

    carla.serve(port=port, host=host, maps=places, seed=seed or 1, ready=ready, log=output.say)


Driver = Annotated[
    str,
    options.option(
        "--driver own|traffic-manager",
        "own: our drivers; traffic-manager: CARLA's at a third of the speed, as in the study.",
    ),
]
Server = Annotated[
    str,
    options.option("--server HOST:PORT", "Address of CARLA 0.9.16, or headless: our own server."),
]


def run(
    output: Output,
    out: options.OutFolder,
    made: options.Making,
    profile: options.ProfileWord = None,
    road: options.Road = None,
    driver: Driver = "own",
    server: Server = "headless",
) -> None:
    """Simulate scenarios on CARLA and write a labelled data set."""
    from overtaking.cli import arguments, making

    arguments.choose_carla(server)
    simulator = arguments.carla_simulator(driver)
    making.make(
        output,
        out,
        making.recipe(made, profile, options.RoadChoice(road=road)),
        made,
        simulator=simulator,
    )


def limits(output: Output, server: Server = "headless") -> None:
    """Measure when CARLA's Traffic Manager refuses lane changes."""
    from overtaking.api import carla
    from overtaking.cli import arguments

    arguments.choose_carla(server)
    found = carla.measure_limits()
    rows = [
        {"speed_kmh": speed, "changed": changed, "asked": found.trials}
        for speed, changed in zip(found.speeds_kmh, found.changed, strict=True)
    ]
    values = {"forced_lane_changes": rows, "again_after_s": found.again_after}
    output.result(values, lambda _: _drawn_limits(values))


def _drawn_limits(values: dict[str, Any]) -> "Group":
    """The limits for people."""
    from rich.console import Group
    from rich.text import Text

    from overtaking.cli.tables import open_table

    table = open_table("km/h>", "changed>", "of>", title="Forced lane changes")
    for row in values["forced_lane_changes"]:
        table.add_row(f"{row['speed_kmh']:.0f}", str(row["changed"]), str(row["asked"]))
    wait = values["again_after_s"]
    again = "never again" if wait is None else f"again {wait:.1f} s after the first"
    return Group(table, Text(f"A second one was accepted {again}."))


Numbers = Annotated[str, options.option("--simulations LIST", options.SIMULATIONS)]
Size = Annotated[str, options.option("--size WxH", "Width and height of the pictures.")]
Films = Annotated[Path, options.option("--out FOLDER", f"{options.OUT} A folder.")]


def replay(
    output: Output,
    data: options.Data,
    out: Films,
    simulations: Numbers = "0",
    size: Size = "800x450",
    server: Server = "headless",
) -> None:
    """Replay recorded simulations in CARLA and film them."""
    from overtaking.api import carla
    from overtaking.cli import arguments

    arguments.choose_carla(server)
    numbers = arguments.numbers(simulations, "carla replay") or []
    pixels = arguments.picture_size(size)
    with output.progress("simulations") as meter:
        films = carla.replay(data, out, simulation_ids=numbers, size=pixels, progress=meter)
    files = [
        {"file": str(path), "frames": film.num_frames} for film in films for path in film.files
    ]
    lines = "\n".join(f"{each['file']}  {each['frames']} frames" for each in files)
    output.wrote({"films": files}, lambda _: lines)
