"""The commands that begin with `overtaking carla`."""

from pathlib import Path
from typing import Annotated

import typer

from overtaking.cli import options
from overtaking.cli.output import Output

PORT = 2000

Port = Annotated[
    int,
    typer.Option("--port", min=0, max=65534, metavar="P", help="For calls; streams get P+1."),
]
Host = Annotated[
    str,
    typer.Option(
        "--host", metavar="ADDRESS", help="Address to listen on; by default nobody else can reach."
    ),
]
Place = Annotated[
    str,
    typer.Option("--map", metavar="NAME|FILE", help="Road of the package, or an OpenDRIVE file."),
]


def serve(
    output: Output,
    port: Port = PORT,
    host: Host = "127.0.0.1",
    place: Place = "town06",
    seed: options.Seed = None,
) -> None:
    """Answer clients of CARLA 0.9.16 without CARLA: no graphics card, our dynamics."""
    from overtaking import api

    def ready(calls: int, streams: int) -> None:
        values = {"host": host, "port": calls, "stream_port": streams, "map": place}
        text = f"ready for CARLA 0.9.16 clients on {host}:{calls} (streams {streams}); Ctrl-C ends"
        output.result(values, lambda _: text)

    api.serve_carla(port=port, host=host, place=place, seed=seed or 1, ready=ready, log=output.say)


Driver = Annotated[
    str,
    typer.Option(
        "--driver",
        metavar="own|traffic-manager",
        help="Our drivers at true speed, or CARLA's at a third of it, as the study did.",
    ),
]
Server = Annotated[
    str,
    typer.Option(
        "--server", metavar="HOST:PORT", help="A running CARLA 0.9.16, or headless: one of our own."
    ),
]


def run(
    output: Output,
    out: options.OutFolder,
    profile: options.ProfileWord = None,
    simulations: options.Simulations = None,
    seed: options.Seed = None,
    driver: Driver = "own",
    server: Server = "headless",
    road: options.Road = None,
    keep: options.Keep = None,
    resume: options.Resume = False,
    yes: options.Yes = False,
    changes: options.Changes = None,
    frame_interval_ms: options.FrameInterval = None,
) -> None:
    """Simulate scenarios of a profile on CARLA and write them as a data set."""
    from overtaking.cli import arguments, making

    arguments.choose_carla(server)
    recipe = arguments.given(
        profile=profile,
        simulations=simulations,
        seed=seed,
        keep=keep,
        road=arguments.road(None, road),
        overrides=arguments.overrides(changes or [], frame_interval_ms),
    )
    making.make(
        output, out, recipe, resume=resume, yes=yes, simulator=arguments.carla_simulator(driver)
    )


def limits(output: Output, server: Server = "headless") -> None:
    """Measure when CARLA's Traffic Manager does not change lanes."""
    from overtaking import api
    from overtaking.cli import arguments, carla_limits

    arguments.choose_carla(server)
    values = carla_limits.values_of(api.carla_limits())
    output.result(values, lambda _: carla_limits.render(values))


Numbers = Annotated[
    str,
    typer.Option("--simulations", metavar="LIST", help="Numbers and ranges, such as 1,7,20-29."),
]
Size = Annotated[
    str, typer.Option("--size", metavar="WxH", help="Width and height of the pictures.")
]
Films = Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Folder for the films.")]


def replay(
    output: Output,
    data: options.Data,
    out: Films,
    simulations: Numbers = "0",
    size: Size = "800x450",
    server: Server = "headless",
) -> None:
    """Play recorded simulations in CARLA and film them with its cameras."""
    from overtaking import api
    from overtaking.cli import arguments
    from overtaking.cli.video import choice

    arguments.choose_carla(server)
    chosen = choice(simulations, is_per_class=False, is_every=False)
    numbers = [int(number) for number in chosen]
    pixels = arguments.picture_size(size)
    with output.progress("simulations") as meter:
        films = api.replay_in_carla(data, out, simulations=numbers, size=pixels, progress=meter)
    files = [
        {"file": str(path), "frames": film.num_frames} for film in films for path in film.files
    ]
    lines = "\n".join(f"{each['file']}  {each['frames']} frames" for each in files)
    output.result({"films": files}, lambda _: lines)


COMMANDS: dict[options.Body, str] = {
    serve: "overtaking carla serve --port 2000",
    run: "overtaking carla run pinto2023 -n 20 --seed 1 --driver own --out data/carla",
    replay: "overtaking carla replay data/pinto --simulations 1,7 --out films",
    limits: "overtaking carla limits",
}
