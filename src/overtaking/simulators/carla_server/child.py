"""A headless server as a worker process, on free ports; it sends its parent the port of calls."""

from overtaking.core.parent import Parent
from overtaking.simulators.carla_server.running import run_server


def main(parent: Parent) -> None:
    """Serve until the parent ends this process."""
    run_server(port=0, ready=lambda port, _: parent.send(port), log=lambda _: None)
