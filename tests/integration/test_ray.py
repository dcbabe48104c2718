"""A Ray cluster makes the same files as one process, whoever dies on the way."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import types
import uuid
from pathlib import Path

import pytest
from tests.support.killer import Killer, contents

import overtaking as ot
from overtaking.core.errors import ConfigError, DatasetError, MissingExtraError
from overtaking.data import ray_executor
from overtaking.data.location import PARTIAL

pytestmark = [
    pytest.mark.ci,
    # Where Ray's first start was too slow, it drops the processes of that try without a wait.
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

NUM_SIMULATIONS = 1500
SETTINGS = {
    "overrides": {"time.horizon_s": 6.0, "time.attempt_deadline_s": 6.0},
    "shard_size": 150,
    "keep": "features",
}


def generate(out: str | Path, **changes) -> ot.Dataset:
    return ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=NUM_SIMULATIONS,
        seed=1,
        out=out,
        **{**SETTINGS, **changes},
    )


@pytest.fixture(scope="module")
def cluster():
    """A cluster of two workers on this machine, for all tests of this file."""
    heard = signal.getsignal(signal.SIGTERM)
    ray = ray_executor._ray(is_only_here=True)
    with ray_executor._cluster(ray, None, 2):
        assert signal.getsignal(signal.SIGTERM) is heard  # Else SIGTERM would end in silence.
        yield ray


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_two_workers_killed_in_the_middle_change_not_one_byte(cluster, tmp_path):
    told: list[int] = []
    with Killer(tmp_path / "killed", kills=2) as killer:
        killed = generate(
            tmp_path / "killed", executor="ray", progress=lambda done, _: told.append(done)
        )
    assert len(killer.killed) == 2
    assert all(name.startswith("ray::") for name in killer.killed.values())
    assert told == list(range(0, NUM_SIMULATIONS + 1, SETTINGS["shard_size"]))
    undisturbed = generate(tmp_path / "undisturbed")
    assert killed.content_hash == undisturbed.content_hash
    assert killed.manifest.shards == undisturbed.manifest.shards
    assert contents(killed.path) == contents(undisturbed.path)


def test_a_cluster_completes_what_threads_have_begun(cluster, tmp_path, monkeypatch):
    def stop(done: int, total: int) -> None:
        if done >= 450:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        generate(tmp_path / "data", progress=stop)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("part-0000[01].parquet")}
    assert before
    monkeypatch.chdir(tmp_path)  # Workers have a working directory of their own.
    completed = ot.resume_dataset("data", executor="ray")
    assert {path: path.stat().st_mtime_ns for path in before} == before
    completed.verify()
    assert len(completed) == NUM_SIMULATIONS


def test_a_place_that_workers_do_not_see_is_refused(cluster):
    with pytest.raises(DatasetError, match=r"expected one that every worker sees, got nothing"):
        generate(f"memory://{uuid.uuid4()}", executor="ray")


def test_what_goes_wrong_in_a_worker_is_told_as_if_it_had_gone_wrong_here(
    cluster, tmp_path, monkeypatch
):
    other = ray_executor._packages() | {"numpy": "0.1"}
    monkeypatch.setattr(ray_executor, "_packages", lambda: other)
    with pytest.raises(ConfigError, match=r"\Aworker on .*: version of numpy: expected 0\.1, got"):
        generate(tmp_path / "data", executor="ray")
    assert not (tmp_path / "data" / PARTIAL).exists()


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_nobody_beyond_this_machine_can_reach_the_cluster(cluster):
    session = cluster._private.worker._global_node.get_session_dir_path()
    ours = {
        int(folder.name)
        for folder in Path("/proc").glob("[0-9]*")
        if session in _read(folder / "cmdline") or _read(folder / "cmdline").startswith("ray::")
    }
    assert len(ours) >= 3  # The store of objects, the keeper of the cluster, workers.
    loopback = {"0100007F", "0000000000000000FFFF00000100007F", f"{1 << 24:032X}"}
    assert set(_listening(ours | {os.getpid()})) <= loopback


def _listening(pids: set[int]) -> list[str]:
    """The addresses, as the kernel writes them, on which some processes listen."""
    sockets = set[str]()
    for pid in pids:
        for handle in Path(f"/proc/{pid}/fd").glob("*"):
            try:
                sockets.add(str(handle.readlink()))
            except OSError:
                continue
    rows = [
        line.split()
        for table in ("tcp", "tcp6")
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]
    ]
    found = [row[1].partition(":")[0] for row in rows if row[3] == "0A"]
    ours = [
        row[1].partition(":")[0]
        for row in rows
        if row[3] == "0A" and f"socket:[{row[9]}]" in sockets
    ]
    assert found
    assert ours
    return ours


def _read(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:
        return ""


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"executor": "spark"}, "executor: expected auto or threads or processes or ray"),
        ({"address": "10.0.0.1:6379"}, "address: expected the executor ray beside it"),
        (
            {"executor": "threads", "workers": 2},
            "workers: expected the executor processes or ray beside it",
        ),
        ({"executor": "processes", "workers": 0}, "workers: expected 1 or more, got 0"),
        ({"executor": "processes", "address": "h:1"}, "got h:1 with processes; add --executor ray"),
        ({"executor": "ray", "workers": 0}, "workers: expected 1 or more, got 0"),
        ({"executor": "ray", "workers": 2, "address": "h:1"}, "expected none beside an address"),
    ],
)
def test_words_that_do_not_fit_are_refused_before_anything_is_made(words, said, tmp_path):
    with pytest.raises(ConfigError, match=said):
        generate(tmp_path / "data", **words)
    assert not (tmp_path / "data").exists()


IMPATIENT = {"RAY_gcs_rpc_server_connect_timeout_s": "1", "RAY_py_gcs_connect_timeout_s": "1"}
"""Makes each attempt of Ray to reach a cluster take 3 s instead of 41 s."""


def refused(address: str, out: Path) -> tuple[str, int]:
    """What is said to an address after nothing was written, and how often Ray tried it."""
    command = [sys.executable, "-m", "overtaking", "generate", "-n", "10", "--out", str(out)]
    command += ["--executor", "ray", "--address", address]
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        timeout=300.0,
        check=False,
        env=os.environ | IMPATIENT,
    )
    assert done.returncode == 2, done.stderr
    assert not (out / "dataset.json").exists()
    said = done.stderr.splitlines()
    (line,) = [one for one in said if one.startswith("error: ")]
    return line, sum("Failed to connect to GCS" in one for one in said)


def test_an_address_at_which_nobody_listens_is_refused_before_anything_is_written(tmp_path):
    with socket.socket() as taken:  # Nobody can listen there, as nobody listens on it.
        taken.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        line, tries = refused(address, tmp_path / "data")
    assert tries == 0
    assert f"expected that of a Ray cluster that runs, got {address}: " in line
    assert "start one with `ray start --head`" in line
    assert not (tmp_path / "data").exists()


def test_an_address_at_which_no_cluster_answers_is_refused(tmp_path):
    with socket.create_server(("", 0)) as mute:
        line, tries = refused(f"127.0.0.1:{mute.getsockname()[1]}", tmp_path / "data")
    assert tries == 1  # Ray by itself would try twenty times.
    assert "expected that of a Ray cluster that runs, got 127.0.0.1:" in line
    ot.generate_dataset(
        "pinto2023-physical", num_simulations=1, seed=1, out=tmp_path / "data"
    )  # The right call is not kept out.


def test_ray_is_not_started_where_others_could_reach_it(tmp_path, monkeypatch):
    ray = types.SimpleNamespace(
        is_initialized=lambda: False,
        util=types.SimpleNamespace(get_node_ip_address=lambda: "192.0.2.1"),
    )
    monkeypatch.setitem(sys.modules, "ray", ray)
    with pytest.raises(ConfigError, match="expected a cluster that only this machine can reach"):
        generate(tmp_path / "data", executor="ray")


def test_ray_that_is_missing_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(MissingExtraError, match=r"executor ray: .*pip install 'ray>="):
        generate(tmp_path / "data", executor="ray")
