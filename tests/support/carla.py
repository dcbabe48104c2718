"""A headless server in a process of its own, and genuine clients of CARLA in others."""

from __future__ import annotations

import json
import os
import platform
import socket
import subprocess
import sys
import textwrap
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest

from overtaking.simulators.carla_server.wire import Decoder, encode

if TYPE_CHECKING:
    from collections.abc import Generator

HAS_WHEEL = (
    sys.version_info < (3, 13)
    and sys.platform in ("linux", "win32")
    and platform.machine() in ("x86_64", "AMD64")
)
stopped_by_signals = pytest.mark.skipif(
    sys.platform == "win32", reason="servers are stopped by signals here"
)
needs_wheel = pytest.mark.skipif(
    not HAS_WHEEL,  # Where there is one, a missing one is a failure.
    reason="carla==0.9.16 has wheels for Python below 3.13 on Linux and Windows on x86-64 alone",
)

PATIENCE = 90.0
"""No client of a test needs longer, on the slowest machine [s]."""

PROLOGUE = """
import json, os, sys, carla
client = carla.Client("127.0.0.1", int(sys.argv[1]))
client.set_timeout(20.0)
world = client.reload_world()
def synchronous(delta=0.05):
    settings = world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = True, delta
    world.apply_settings(settings)
def at(x, y, yaw=0.0):
    return carla.Transform(carla.Location(x, y, 0.3), carla.Rotation(yaw=yaw))
def spawn(name, x, y):
    return world.spawn_actor(world.get_blueprint_library().find(name), at(x, y))
"""

EPILOGUE = """
sys.stdout.flush()
os._exit(0)
"""
"""Ends a client as ours ends: CARLA's lets go of what listened to a sensor in a thread of its own,
and aborts where Python ends meanwhile."""


class Address(NamedTuple):
    """Where a server is, and which process it is."""

    port: int
    streams: int
    process: int


@contextmanager
def headless_server(*arguments: str) -> Generator[Address]:
    """A server on free ports, ended afterwards."""
    command = [sys.executable, "-m", "overtaking", "carla", "serve", "--port", "0", "--json"]
    process = subprocess.Popen([*command, *arguments], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        said = ""
        while not said.rstrip().endswith("}"):
            line = process.stdout.readline()
            assert line, f"the server ended before it was ready: {said}"
            said += line
        ports = json.loads(said)
        yield Address(ports["port"], ports["stream_port"], process.pid)
        assert process.poll() is None, "the server did not live to the end"
    finally:
        process.terminate()
        process.wait(timeout=20.0)
        if process.stdout is not None:
            process.stdout.close()


def ask(address: Address, script: str, *, patience: float = PATIENCE) -> Any:
    """What a client says last, as JSON.

    Args:
        address: Where the server is.
        script: Python; `PROLOGUE` stands before it, `EPILOGUE` behind.
        patience: How long it may take [s].
    """
    code = PROLOGUE + textwrap.dedent(script) + EPILOGUE
    free = str(free_port())
    command = [sys.executable, "-c", code, str(address.port), free]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=patience, check=False, env={**os.environ}
    )
    assert done.returncode == 0, f"status {done.returncode}: {done.stderr[-2000:]}"
    return json.loads(done.stdout.strip().split("\n")[-1])


def answer_of(port: int, *message: object) -> object:
    """What the server answers to a call on a connection of its own."""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as plug:
        plug.sendall(encode([0, 1, *message]))
        decoder = Decoder()
        while data := plug.recv(1 << 16):
            if answers := decoder.feed(data):
                return answers[0]
    return None


def free_port() -> int:
    """A port that nobody uses now, like the next; outgoing connections get others."""
    first = 20_000 + os.getpid() % 5_000
    for port in range(first, first + 5_000, 2):
        try:
            with socket.socket() as one, socket.socket() as other:
                one.bind(("", port))
                other.bind(("", port + 1))
        except OSError:
            continue
        return port
    raise AssertionError("no port is free")


def memory_kb(process: int) -> int:
    """Resident memory of a process [KiB]."""
    status = Path(f"/proc/{process}/status").read_text(encoding="ascii")
    return next(int(line.split()[1]) for line in status.split("\n") if line.startswith("VmRSS"))
