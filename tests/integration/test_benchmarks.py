"""The benchmark of the peers, and the comparison of processors, do what they say."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.ci

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"

REPLAYED = """
import sys
from pathlib import Path
import arm

files, expected = arm.batches(Path(sys.argv[1]))
first = bytearray(files[0].read_bytes())
first[56] ^= 1  # the seed
files[0].write_bytes(first)
found = arm.replay(arm.build(), files=files)
print(*(one == other for one, other in zip(found, expected, strict=True)))
"""


IN_SMALL_BATCHES = """
import sys
import accidents

accidents.BATCH = 16  # 17 km: the usual 64 simulations would be more than is asked for.
sys.exit(accidents.main())
"""


def run(*command: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *command], capture_output=True, text=True, check=False, cwd=BENCHMARKS
    )


def test_engine_and_peers_are_compared_in_one_run():
    done = run("engine.py", "--turns", "1", "--seconds", "0.01", "--json")
    rows = {row["name"]: row for row in json.loads(done.stdout) if "slower" in row}
    ours = rows["engine, 5 vehicles, 10 s"]
    peers = [name for name in rows if not name.startswith("engine")]
    assert peers[:3] == [
        "libsumo, getters",
        "libsumo, nothing read",
        "libsumo, sub-lane model, getters",
    ], done.stderr
    assert "highway-env" in peers or "pip install highway-env" in done.stderr
    for name in peers:
        assert math.isclose(rows[name]["vehicle_seconds"], 5 * 10.0 * rows[name]["core"])
    for row in rows.values():
        ratio = ours["vehicle_seconds"] / row["vehicle_seconds"]
        assert row["slower"] == pytest.approx([ratio] * 3)


def test_replayed_simulations_have_the_same_hashes_at_every_level_of_this_processor():
    done = run("arm.py", "--here", "--json")
    found = json.loads(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr
    assert {row["name"]: row["value"] for row in found}["portable: differences"] == 0


def test_replayed_simulations_with_another_seed_have_other_hashes(tmp_path: Path):
    done = run("-c", REPLAYED, tmp_path)
    same = done.stdout.split()
    assert set(same[:56]) == {"False"}, done.stderr
    assert set(same[56:]) == {"True"}
    assert len(same) == 256


def test_accidents_are_told_with_what_was_believed_and_driving_goes_on_where_it_stopped(tmp_path):
    kept = tmp_path / "kept.json"
    asked = ("-c", IN_SMALL_BATCHES, "pinto2023", "--seed", "2", "--json")
    first = run(*asked, "--km", "10", f"--kept={kept}")
    on = run(*asked, "--km", "40", f"--kept={kept}")
    whole = run(*asked, "--km", "40")
    assert first.returncode == on.returncode == whole.returncode == 0, whole.stderr
    # Distances are summed in the same order, whether it was stopped or not.
    assert json.loads(on.stdout) == json.loads(whole.stdout)
    found = json.loads(whole.stdout)
    assert json.loads(first.stdout)["km"] < 40.0 <= found["km"]
    assert found["all"]["count"] == len(found["accidents"]) > 3
    assert found["all"]["low"] < found["all"]["rate"] < found["all"]["high"]
    assert sum(one["count"] for one in found["by_severity"].values()) == found["all"]["count"]
    assert sum(found["by_mechanism"].values()) == found["all"]["count"]
    touched = [one for one in found["accidents"] if len(one["vehicles"]) > 1]
    believed = [each["believed"] for one in touched for each in one["beliefs"]]
    assert any(one and one["noticed"] for one in believed)
    other = run(*asked, "--seed", "3", "--km", "40", f"--kept={kept}")
    assert other.returncode == 1
    assert "give another --kept" in other.stderr


GAMMA = """
import json
import numpy as np
from conflicts import gamma_interval

count, number = 7, 1000
happened = (np.arange(number) < count).astype(float)
print(json.dumps([gamma_interval(np.full(number, w), happened) for w in (1.0, 0.5)]))
"""


def test_the_interval_of_a_rate_with_equal_weights_is_the_exact_one_of_poisson():
    done = run("-c", GAMMA)
    (rate, low, high), halved = json.loads(done.stdout)
    # Garwood 1936, as tabled: 7 events, 2.81 to 14.42.
    assert rate == pytest.approx(7e-3)
    assert low == pytest.approx(2.81e-3, abs=5e-6)
    assert high == pytest.approx(14.42e-3, abs=5e-6)
    assert halved == pytest.approx([0.5 * rate, 0.5 * low, 0.5 * high])


def test_the_pages_list_what_mutations_break():
    rows = "[print(f'| `{mutation.file}` | {mutation.meaning} |') for mutation in MUTATIONS]"
    done = run("-c", f"from mutations import MUTATIONS; {rows}")
    page = (BENCHMARKS / "README.md").read_text(encoding="utf-8")
    part = page.partition("## Broken on purpose")[2].partition("\n## ")[0]
    listed = [line for line in part.splitlines() if line.startswith("| `")]
    assert done.stdout.splitlines() == listed != []


MISSING_LINES = """
import flips, mutations

every = flips.flips_of(flips.ROOT / "crates" / "overtaking-core" / "src")
for mutation in mutations.MUTATIONS:
    mutations.flip_of(mutation, every)
equivalent = flips.EQUIVALENT.keys() | {
    line for lines in flips.EQUIVALENT_AT.values() for line in lines
}
for line in equivalent - {flip.marked for flip in every}:
    print(line)
"""


def test_the_engine_has_the_lines_of_the_mutations_and_of_the_equivalent_flips():
    # Both programs take minutes to find an outdated line, because they first build the engine.
    assert run("-c", MISSING_LINES).stdout == ""
