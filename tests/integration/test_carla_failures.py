"""What becomes of scenarios on CARLA when the server dies, hangs, refuses or is another."""

from __future__ import annotations

import asyncio
import gc
import os
import signal
import socket
import threading
import time
import warnings
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest
from tests.support.carla import headless_server, needs_wheel, stopped_by_signals
from tests.support.processes import eventually
from tests.support.worlds import Vehicle, scenario

import overtaking as ot
from overtaking.cli import main
from overtaking.core.errors import ConfigError
from overtaking.simulators.carla import processes
from overtaking.simulators.carla import run as carla
from overtaking.simulators.carla.jobs import LOADING
from overtaking.simulators.carla.library import HEADLESS, SERVER_VARIABLE
from overtaking.simulators.carla.world import SimulationLostError
from overtaking.simulators.carla_server import server as serving
from overtaking.simulators.carla_server.arguments import Settings
from overtaking.simulators.carla_server.maps import Atlas, known_map
from overtaking.simulators.carla_server.streams import Streams
from overtaking.simulators.carla_server.survey import survey
from overtaking.simulators.carla_server.wire import Decoder, encode
from overtaking.simulators.carla_server.world import World

if TYPE_CHECKING:
    from collections.abc import Generator
    from pathlib import Path

    import numpy as np

    from overtaking.model.scenario import Scenario

pytestmark = [
    pytest.mark.ci,
    needs_wheel,
    stopped_by_signals,
]

SHORT = ["--set", "time.horizon_s=2", "--set", "time.attempt_deadline_s=2"]


def lone_ego(horizon: float = 2.0, s: float = 380.0) -> Scenario:
    """An ego and a car ahead of it, or in the same place."""
    ego = Vehicle(kind="M", s=320.0, lane=1, speed=25.0)
    return scenario([ego, Vehicle(kind="S", s=s, lane=1, speed=25.0)], horizon=horizon)


def in_background(act: object) -> threading.Thread:
    thread = threading.Thread(target=act)  # type: ignore[arg-type]
    thread.start()
    return thread


def test_a_server_that_hangs_is_replaced_and_the_result_the_same(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv(SERVER_VARIABLE, HEADLESS)
    expected = carla.simulate(lone_ego(horizon=6.0)).trace_hash
    found: list[np.ndarray] = []
    thread = in_background(lambda: found.append(carla.simulate(lone_ego(horizon=6.0)).trace_hash))
    time.sleep(0.5)
    (hung,) = processes.servers()
    os.kill(hung, signal.SIGSTOP)
    # On a busy machine it may hang while the map is still loading, for which there is patience.
    thread.join(2.0 * LOADING)
    assert not thread.is_alive()
    assert (found[0] == expected).all()
    assert processes.servers() != [hung]


def test_a_client_that_died_is_closed_before_it_is_replaced(monkeypatch: pytest.MonkeyPatch):
    """Its pipes were left open, and the warning hit whichever test ran next."""
    monkeypatch.setenv(SERVER_VARIABLE, HEADLESS)
    for _ in range(2):
        carla.simulate(lone_ego(horizon=0.5))
        (client,) = processes.workers()
        os.kill(client, signal.SIGKILL)
        assert eventually(lambda: not processes.workers())
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        carla.simulate(lone_ego(horizon=0.5))
        gc.collect()
    assert [str(one.message) for one in said] == []


def test_a_server_that_dies_leaves_a_list_of_what_is_missing_and_resume_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
):
    monkeypatch.setenv(SERVER_VARIABLE, HEADLESS)  # Put back afterwards, whatever --server sets.
    words = [
        "carla",
        "run",
        "pinto2023-physical",
        "-n",
        "10",
        "--seed",
        "4",
        "--out",
        str(tmp_path / "data"),
    ]
    words += [*SHORT, "--quiet"]
    told: list[int] = []

    def run_until_it_dies() -> None:
        with headless_server() as there:
            given = [*words, "--server", f"127.0.0.1:{there.port}"]
            thread = in_background(lambda: told.append(main(given)))
            while not any((tmp_path / "data").glob("simulations/*.parquet")):
                time.sleep(0.05)
            os.kill(there.process, signal.SIGKILL)
            thread.join(2.0 * LOADING)

    with pytest.raises(AssertionError, match="did not live to the end"):
        run_until_it_dies()
    assert told == [2]
    error = capsys.readouterr().err
    assert "simulations 8, 9: expected a result" in error
    assert "--resume" in error
    assert len(error.strip().splitlines()) == 1
    with headless_server() as there:
        assert main([*words, "--resume", "--server", f"127.0.0.1:{there.port}"]) == 0
    processes.dismiss()
    data = ot.load_dataset(tmp_path / "data")
    data.verify()
    assert data.simulations()["scenario_index"].tolist() == list(range(10))


def test_a_spawn_that_is_refused_is_named_and_the_others_are_run(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv(SERVER_VARIABLE, HEADLESS)
    monkeypatch.setattr(processes, "ATTEMPTS", 1)
    with pytest.raises(SimulationLostError, match=r"simulations 0: .*refusal of the server"):
        carla.simulate(lone_ego(s=320.0))
    assert carla.simulate(lone_ego()).num_frames[0] == 41


@contextmanager
def older_server() -> Generator[int]:
    """Something that says of itself that it is CARLA 0.9.15, and no more."""
    with socket.create_server(("127.0.0.1", 0)) as plug:

        def answer() -> None:
            while True:
                try:
                    link, _ = plug.accept()
                except OSError:
                    return
                in_background(lambda link=link: speak(link))

        def speak(link: socket.socket) -> None:
            decoder = Decoder()
            with link:
                while data := link.recv(1 << 12):
                    for message in decoder.feed(data):
                        link.sendall(encode([1, message[1], None, [[1, "0.9.15"]]]))

        thread = in_background(answer)
        yield plug.getsockname()[1]
        plug.shutdown(socket.SHUT_RDWR)
    thread.join(10.0)


def test_a_server_of_another_version_is_refused_with_both_versions(monkeypatch: pytest.MonkeyPatch):
    with older_server() as port:
        monkeypatch.setenv(SERVER_VARIABLE, f"127.0.0.1:{port}")
        with pytest.raises(ConfigError, match=r"expected 0\.9\.16, got 0\.9\.15"):
            carla.simulate(lone_ego())
        processes.dismiss()


def test_a_client_that_falls_silent_between_its_ticks_is_told_of_once(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(serving, "SILENCE", 0.04)
    log: list[str] = []
    world = World(Atlas([known_map("town06")], survey), Streams(log.append), 1)
    world.settings = Settings()._replace(synchronous=True)
    server = serving.Server(world, log.append, managers={8000: "127.0.0.1"})

    async def wait() -> None:
        watching = asyncio.create_task(server.watch())
        await asyncio.sleep(0.4)
        watching.cancel()

    asyncio.run(wait())
    (line,) = log
    assert "after frame 0 although a Traffic Manager runs" in line
    server.managers.clear()
    asyncio.run(wait())
    assert len(log) == 1
