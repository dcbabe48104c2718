"""Scenarios on CARLA through the genuine client, on a headless server."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.carla import free_port, needs_wheel
from tests.support.processes import eventually, is_running
from tests.support.worlds import Vehicle, scenario

import overtaking as ot
from overtaking.cli import main
from overtaking.core.errors import ConfigError
from overtaking.model.trajectories import Stage
from overtaking.simulators.carla import processes, traffic
from overtaking.simulators.carla import run as carla
from overtaking.simulators.carla.jobs import LOADING
from overtaking.simulators.carla.library import SERVER_VARIABLE
from overtaking.simulators.carla.world import SimulationLostError

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.model.scenario import Scenario
    from overtaking.model.trajectories import Trajectories

pytestmark = [pytest.mark.ci, needs_wheel]

FAST_EGO = {"desired_speed": 33.3, "min_speed_gain": 1.0, "accel": 1.8, "lane_change_duration": 4.0}


@pytest.fixture(autouse=True)
def headless(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SERVER_VARIABLE, "headless")


def overtake(speed: float = 33.3, horizon: float = 18.0) -> Scenario:
    """A fast ego 60 m behind a slower car on the road of the study."""
    ego = Vehicle(
        kind="M", s=320.0, lane=1, speed=speed, driver=FAST_EGO | {"desired_speed": speed}
    )
    return scenario([ego, Vehicle(kind="S", s=380.0, lane=1, speed=22.0)], horizon=horizon)


def metres(run: Trajectories, name: str, slot: int = 0) -> np.ndarray:
    return getattr(run.states, name)[0, slot, : run.num_frames[0]] * 1e-3


@pytest.fixture(scope="module")
def overtaken() -> Trajectories:
    """The overtake, driven by our driver on CARLA."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(SERVER_VARIABLE, "headless")
        return carla.simulate(overtake())


def test_our_driver_overtakes_at_120_kmh_through_the_genuine_client(overtaken: Trajectories):
    run = overtaken
    stages = run.stage[0, : run.num_frames[0]].tolist()
    assert [stage for stage in dict.fromkeys(stages) if stage != Stage.FOLLOW] == [
        Stage.PULL_OUT,
        Stage.PASS,
        Stage.RETURN,
        Stage.DONE,
    ]
    passing = run.stage[0, : run.num_frames[0]] == Stage.PASS
    assert metres(run, "speed")[passing].min() * 3.6 > 120.0
    assert (run.contacts.partner == 255).all()
    assert run.unknown == frozenset()


def test_it_drives_as_in_our_own_simulation(overtaken: Trajectories):
    """The same drivers, the same bodies' motion: only pedals and a wheel lie between."""
    there, here = overtaken, ot.simulate(overtake())
    frames = min(int(there.num_frames[0]), int(here.num_frames[0]), 160)
    for name, most in (("s", 2.5), ("d", 0.5), ("speed", 0.6)):
        apart = np.abs(metres(there, name)[:frames] - metres(here, name)[:frames])
        assert apart.max() < most, name


def test_bodies_and_lanes_are_those_that_carla_reports(overtaken: Trajectories):
    run = overtaken
    # The Leon is nearest to 4.4 m among CARLA's medium cars, the A2 to 3.75 m among the small.
    assert run.scenario.vehicles.length[0, :2] == pytest.approx([4.514, 3.705], abs=0.01)
    assert [lane.lane_id for lane in run.road.lanes] == [-7, -6, -5, -4, -3]
    assert run.road.lanes[0].right_mark.value == "Solid"


def test_the_same_simulation_has_the_same_hash_in_any_batch():
    given = ot.sample("pinto2023-physical", num_simulations=2, seed=5).replace(
        horizon=np.full(2, 3.0, np.float32)
    )
    both = carla.simulate(given)
    alone = carla.simulate(given.select(slice(1, 2)))
    assert (both.trace_hash[1] == alone.trace_hash[0]).all()
    assert (both.trace_hash[0] != both.trace_hash[1]).any()


def test_at_a_third_of_the_speed_places_speeds_and_time_agree_after_conversion():
    """dL/dTS = V: what the study's conversion needs and every third tick gives."""
    run = traffic.simulate(overtake(speed=30.0, horizon=6.0))
    again = traffic.simulate(overtake(speed=30.0, horizon=6.0))
    assert (run.trace_hash == again.trace_hash).all()
    for slot in (0, 1):
        s, speed = metres(run, "s", slot), metres(run, "speed", slot)
        moved = (s[2:] - s[:-2]) / 0.1
        settled = slice(20, None)  # Not while the Traffic Manager takes its speed up.
        assert moved[settled] == pytest.approx(speed[1:-1][settled], abs=0.35)
    assert metres(run, "speed", 1)[-1] == pytest.approx(22.0, abs=0.3)
    assert run.unknown == {"percepts", "wheel_angle"}
    assert Stage.PULL_OUT in run.stage[0]


def test_the_limits_that_the_study_met_are_those_of_the_client(capsys: pytest.CaptureFixture):
    """A forced change works up to 36 km/h and not from 38 on, nor twice in a row within 12 s."""
    assert main(["carla", "limits", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    changed = {row["speed_kmh"]: row["changed"] for row in found["forced_lane_changes"]}
    assert changed.pop(50.0) <= 1  # By luck: where a waypoint happens to be near enough.
    assert changed == {20.0: 4, 30.0: 4, 34.0: 4, 36.0: 4, 38.0: 0, 40.0: 0, 42.0: 0}
    assert 12.0 < found["again_after_s"] < 13.0


def test_a_client_that_is_killed_is_replaced_and_the_result_the_same():
    expected = carla.simulate(overtake(horizon=4.0)).trace_hash
    found: list[Trajectories] = []
    thread = threading.Thread(target=lambda: found.append(carla.simulate(overtake(horizon=4.0))))
    thread.start()
    time.sleep(1.0)
    (worker,) = processes.workers()
    os.kill(worker, signal.SIGKILL)
    thread.join(2.0 * LOADING)
    assert (found[0].trace_hash == expected).all()


def test_a_recorded_simulation_is_played_pose_by_pose_and_filmed(tmp_path: Path):
    import av

    short = {"time.horizon_s": 0.6, "time.attempt_deadline_s": 0.6}
    data = ot.generate_dataset(
        "pinto2023-physical", num_simulations=1, seed=3, out=tmp_path / "data", overrides=short
    )
    words = [
        "carla",
        "replay",
        str(data.path),
        "--out",
        str(tmp_path / "films"),
        "--size",
        "320x180",
    ]
    assert main([*words, "--quiet"]) == 0
    files = sorted((tmp_path / "films").iterdir())
    assert [path.name for path in files] == ["000000-above.mp4", "000000-behind.mp4"]
    frames = int(data.trajectory(0).num_frames[0])
    pictures: list[np.ndarray] = []
    for path in files:
        with av.open(str(path)) as film:
            found = [one.to_ndarray(format="rgb24") for one in film.decode(video=0)]
        assert len(found) == frames
        pictures.append(found[-1])
    above, behind = pictures
    assert above.shape == behind.shape == (180, 320, 3)
    # The red lamps of the ego are in the middle of the picture from behind, and only there.
    red = behind[..., 0].astype(int) - behind[..., 1] > 80
    assert red[:, 100:220].any()
    assert not red[:, :100].any()
    assert main([*words[:-1], "wide"]) == 2


STARTS_A_SERVER = """
import sys
from overtaking.core.worker_process import WorkerProcess
server = WorkerProcess("overtaking.simulators.carla_server.running")
assert server.receive(60.0) > 0
print(server.pid, flush=True)
sys.stdin.read()
"""


def test_the_headless_server_is_gone_when_the_process_that_started_it_is_killed():
    command = [sys.executable, "-c", STARTS_A_SERVER]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        server = int(parent.stdout.readline())
        assert is_running(server)
        parent.kill()
    assert eventually(lambda: not is_running(server))


def test_a_server_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch):
    port = free_port()
    monkeypatch.setenv(SERVER_VARIABLE, f"127.0.0.1:{port}")
    monkeypatch.setattr(processes, "ATTEMPTS", 1)
    # Its client says it, or who looks after the server if the client is slow to start.
    with pytest.raises((ConfigError, SimulationLostError), match=f"127.0.0.1:{port}"):
        carla.simulate(overtake(horizon=1.0))


def test_the_command_writes_a_data_set_with_labels(tmp_path: Path, capsys: pytest.CaptureFixture):
    out = tmp_path / "data"
    words = [
        "carla",
        "run",
        "pinto2023-physical",
        "-n",
        "1",
        "--seed",
        "2",
        "--out",
        str(out),
        "--json",
    ]
    short = ["--set", "time.horizon_s=4", "--set", "time.attempt_deadline_s=4"]
    assert main([*words, *short]) == 0
    assert json.loads(capsys.readouterr().out)["simulations"] == 1
    data = ot.load_dataset(out)
    assert data.features().shape[0] == 1
    assert main([*words[:-1], *short, "--resume"]) == 0
    assert main(["carla", "run", "--out", str(tmp_path / "b"), "--driver", "ghost"]) == 2
    assert "own or traffic-manager" in capsys.readouterr().err
