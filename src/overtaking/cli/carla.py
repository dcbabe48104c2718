"""The commands that begin with `overtaking carla`."""

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


COMMANDS: dict[options.Body, str] = {
    serve: "overtaking carla serve --port 2000",
}
