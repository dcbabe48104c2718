"""Where the system grants too little, a call ends with one line and a next step."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

import overtaking as ot
from overtaking.core import process_limits
from overtaking.core.errors import SystemLimitError

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = [
    pytest.mark.ci,
    pytest.mark.skipif(sys.platform != "linux", reason="needs the limits of Linux"),
]

REPORT = """
def report(work):
    import overtaking as ot
    try:
        work()
    except ot.OvertakingError as error:
        print("refused:", error)
    except BaseException as error:
        print("fault:", type(error).__name__, error)
    else:
        print("done")
"""

THREADS = (
    REPORT
    + """
import sys
import overtaking as ot
folder, out = sys.argv[1:]
scenarios = ot.sample("pinto2023-physical", num_simulations=8, seed=1)
report(lambda: ot.simulate(scenarios))
report(lambda: ot.load_dataset(folder).features())
report(lambda: ot.load_dataset(folder).states(3))
report(lambda: ot.sql(folder, "SELECT count(*) FROM simulations"))
report(lambda: ot.generate_dataset("pinto2023-physical", num_simulations=8, seed=1, out=out))
"""
)

ADDRESSES = """
import sys
out = sys.argv[1]
try:
    import overtaking as ot
except Exception:
    print("no import")
    sys.exit()
try:
    ot.generate_dataset("pinto2023-physical", num_simulations=16, seed=1, out=out)
    recorded = ot.load_dataset(out)[3]
    ot.label(recorded)
    ot.load_dataset(out).features()
except ot.OvertakingError as error:
    print("refused:", error)
except BaseException as error:
    print("fault:", type(error).__name__, error)
else:
    print("done")
"""

RANDOM_WORDS = """
import resource
import numpy as np
from overtaking import _core
count = 4 << 20
index, stream = np.zeros(count, np.uint64), np.zeros(count, np.uint32)
with open("/proc/self/statm") as statm:
    used = int(statm.read().split()[0]) * resource.getpagesize()
# The four arrays of words take 64 MiB.
resource.setrlimit(resource.RLIMIT_AS, (used + (96 << 20),) * 2)
words = _core.random_words(seed=1, index=index, stream=stream, draw=0)
print(sum(word.nbytes for word in words) >> 20)
"""

FEWEST_THREADS = {"RAYON_NUM_THREADS": "2", "OMP_NUM_THREADS": "2"}
"""With more of them the largest of the limits below would not be enough on large machines."""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("limits") / "data"
    ot.generate_dataset("pinto2023-physical", num_simulations=8, seed=1, out=folder)
    return folder


def run_limited(limit: str, *words: str, user: tuple[str, ...] = ()) -> str:
    """Standard output of a Python process under a limit of `ulimit`."""
    line = ["bash", "-c", f'ulimit {limit}; exec "$@"', "bash", sys.executable, *words]
    process = subprocess.run(
        [*user, *line],
        check=False,
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, **FEWEST_THREADS},
    )
    assert "Traceback" not in process.stderr, process.stderr
    assert process.returncode >= 0, f"ended by signal {-process.returncode}: {process.stderr}"
    return process.stdout


def other_user() -> tuple[str, ...]:
    """Words that run a command as a user whom `ulimit -u` limits; root has no such limit."""
    capabilities = "-all,+dac_override,+dac_read_search"
    user = ["setpriv", "--reuid=54321", "--regid=54321", "--clear-groups"]
    return (*user, f"--inh-caps={capabilities}", f"--ambient-caps={capabilities}")


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0 or shutil.which("setpriv") is None,
    reason="needs root and setpriv to start processes as a user with a limit of threads",
)
@pytest.mark.parametrize("threads", [2, 4])
def test_without_threads_every_call_is_refused_and_no_file_is_called_damaged(
    dataset, tmp_path, threads
):
    words = ("-c", THREADS, str(dataset), str(tmp_path / "out"))
    lines = run_limited(f"-u {threads}", *words, user=other_user()).splitlines()
    assert len(lines) == 5, lines
    for line in lines:
        assert line.startswith("refused: "), line
        assert "threads: expected a system that starts them, got " in line
        assert "ulimit -u" in line
        assert "restore" not in line


def check_limit(limit_mib: int, out: Path) -> str:
    printed = run_limited(f"-v {limit_mib * 1024}", "-c", ADDRESSES, str(out))
    verdict = printed.partition(":")[0].strip()
    assert verdict in ("done", "refused", "no import"), f"{limit_mib} MiB: {printed}"
    return verdict


def test_with_few_addresses_a_run_succeeds_or_is_refused(tmp_path):
    limits = (40, 150, 300, 450, 520, 560, 640, 2048)
    verdicts = [check_limit(limit, tmp_path / str(limit)) for limit in limits]
    assert verdicts[0] in ("refused", "no import")
    assert verdicts[-1] == "done"


@pytest.mark.soak
def test_at_each_of_forty_limits_of_addresses_a_run_succeeds_or_is_refused(tmp_path):
    limits = [40 + 20 * k for k in range(40)]
    verdicts = {check_limit(limit, tmp_path / str(limit)) for limit in limits}
    assert "refused" in verdicts


def test_commands_print_one_line_where_memory_is_short(tmp_path):
    words = ["bash", "-c", 'ulimit -v 200000; exec "$@"', "bash", sys.executable, "-m"]
    words += ["overtaking", "generate", "-n", "8", "--out", str(tmp_path / "data")]
    process = subprocess.run(words, check=False, capture_output=True, text=True, timeout=300)
    assert process.returncode == 2
    assert process.stdout == ""
    assert process.stderr.startswith("error: generate: memory: expected at least ")
    assert process.stderr.count("\n") == 1
    assert not (tmp_path / "data").exists()


def test_a_run_larger_than_the_limit_of_a_container_is_refused_before_it_begins(
    tmp_path, monkeypatch
):
    mib = 1 << 20
    monkeypatch.setattr(process_limits, "_cgroup_memory", lambda: iter([(600 * mib, 500 * mib)]))
    with pytest.raises(SystemLimitError, match=r"generate: memory: expected at most the 105 MB"):
        ot.generate_dataset("motorway", num_simulations=100, seed=1, out=tmp_path / "data")
    assert not (tmp_path / "data").exists()
    with pytest.raises(SystemLimitError, match=r"simulate: memory: expected at most the 105 MB"):
        ot.simulate(ot.sample("motorway", num_simulations=100, seed=1))
    ot.generate_dataset("motorway", num_simulations=2, seed=1, out=tmp_path / "data")


def test_random_words_need_memory_for_their_own_arrays_only():
    command = [sys.executable, "-c", RANDOM_WORDS]
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (process.returncode, process.stdout.strip()) == (0, "64"), process.stderr
