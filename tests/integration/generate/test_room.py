"""Disks that fill up, files that may not grow, and memory that stays as it is."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from tests.support.small import generate

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.ci

UNTIL_FULL = """
import shutil, sys
from pathlib import Path
import overtaking as ot
from overtaking.core.errors import DatasetError
disk, room = Path(sys.argv[1]), int(sys.argv[2])
ballast = disk / "ballast"
ballast.write_bytes(bytes(shutil.disk_usage(disk).free - room))
def generate(resume):
    return ot.generate_dataset("pinto2023-physical", num_simulations=20, seed=1, out=disk / "data",
                        shard_size=8, resume=resume,
                        overrides={"time.horizon_s": 1.0, "time.attempt_deadline_s": 1.0})
try:
    generate(resume=False)
except DatasetError as error:
    print(error)
print((disk / "data" / ".partial").exists(), len(list(disk.glob("data/simulations/*"))))
ballast.unlink()
data = generate(resume=True)
data.verify()
print(data.content_hash)
"""

WITH_SMALL_DISK = 'mount -t tmpfs -o size=4m tmpfs "$1" && exec "$2" -c "$3" "$1" "$4"'


def test_a_disk_that_fills_up_ends_in_one_line_and_loses_nothing(data, tmp_path: Path):
    """On a disk of four megabytes that only this test sees (Linux, user namespaces)."""
    sizes = [
        sum(path.stat().st_size for path in data.path.glob(f"*/part-0000{n}*")) for n in (0, 1)
    ]
    room = sizes[0] + sizes[1] // 2 + 14 * 4096  # One shard, half of another, and its folders.
    done = subprocess.run(
        [
            *("unshare", "-rm", "sh", "-c", WITH_SMALL_DISK, "sh"),
            *(str(tmp_path), sys.executable, UNTIL_FULL, str(room)),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    message, left, content = done.stdout.splitlines()
    assert str(tmp_path / "data") in message
    assert "got No space left on device; make room or choose another folder; --resume" in message
    assert left == "False 1"
    assert content == data.content_hash


LIMITED = """
import resource, sys
import overtaking as ot
from overtaking.core.errors import DatasetError
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
try:
    ot.generate_dataset("pinto2023-physical", num_simulations=20, seed=1, out=sys.argv[1],
                 shard_size=8, overrides={"time.horizon_s": 1.0, "time.attempt_deadline_s": 1.0})
except DatasetError as error:
    print(error, file=sys.stderr)
    sys.exit(2)
"""


@pytest.mark.parametrize("missing", [1, 10_000])
def test_a_file_that_may_not_grow_ends_in_one_line(missing: int, data, tmp_path: Path):
    """The system's limit on the length of files: a write is refused wherever it happens to be."""
    out = tmp_path / "data"
    largest = max(path.stat().st_size for path in data.path.rglob("*.parquet"))
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(out), str(largest - missing)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    assert "expected room and permission to write, got File too large;" in done.stderr
    assert not (out / ".partial").exists()
    assert generate(out, resume=True).content_hash == data.content_hash


MEASURED = """
import resource, sys
import overtaking as ot
ot.generate_dataset("pinto2023-physical", num_simulations=int(sys.argv[2]), seed=1,
             out=sys.argv[1], shard_size=2048,
             overrides={"time.horizon_s": 2.0, "time.attempt_deadline_s": 2.0})
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def peak_memory(out: Path, simulations: int) -> int:
    """The most memory that a process has needed, in the system's unit."""
    command = [sys.executable, "-c", MEASURED, str(out), str(simulations)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return int(done.stdout)


def test_memory_is_flat_in_the_number_of_simulations(tmp_path: Path):
    # As many pieces as may be under way at a time, and several times as many.
    few, many = (peak_memory(tmp_path / str(n), n) for n in (4 * 1024, 16 * 1024))
    # Allocators keep some slack; keeping all simulations would need several times as much.
    assert many < 1.2 * few
