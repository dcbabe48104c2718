"""What is fuzzed: sound inputs, how they are damaged, and who must bear it.

A new target is one entry of `TARGETS`. Its functions import what they need themselves.
"""

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fuzz_arrays
import fuzz_shards
from damage import damaged_text
from fuzz_readers import READERS

MANIFEST = "dataset.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """One reader, or one public function.

    Attributes:
        name: What it is called on the command line.
        corpus: Sound inputs; made once, and may leave files in the folder.
        damaged: A damaged copy of one of them.
        call: Gives the damaged one to the package; the folder is the same. Any exception but an
            `OvertakingError` is a fault, and so is a warning.
    """

    name: str
    corpus: Callable[[Path], Sequence[Any]]
    damaged: Callable[[Any, random.Random], Any]
    call: Callable[[Any, Path], object]


def _data_set(folder: Path) -> list[str]:
    """The manifests that a data set in the folder might have; the last one is its own."""
    import overtaking as ot
    from overtaking import ClassBalance

    elsewhere = folder / "balanced"
    balance = ClassBalance(candidates=20, allows_missing=True)
    ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=6,
        seed=1,
        out=elsewhere,
        keep="features",
        balance=balance,
    )
    ot.generate_dataset("motorway", num_simulations=6, seed=1, out=folder / "data", shard_size=4)
    return [(path / MANIFEST).read_text(encoding="utf-8") for path in (elsewhere, folder / "data")]


def _load(manifest: bytes, folder: Path) -> None:
    import overtaking as ot

    (folder / "data" / MANIFEST).write_bytes(manifest)
    data = ot.load_dataset(folder / "data")
    assert repr(data)
    data.labels()
    assert len(data[-1].trace_hash) == 1


def _profiles(_folder: Path) -> list[str]:
    from overtaking.scenarios.profiles import PROFILE_FOLDER

    return [path.read_text(encoding="utf-8") for path in sorted(PROFILE_FOLDER.glob("*.toml"))]


def _simulate(text: bytes, folder: Path) -> None:
    import overtaking as ot

    path = folder / "specification.toml"
    path.write_bytes(text)
    runs = ot.simulate(ot.sample(path, num_simulations=3, seed=1))
    ot.label(runs)


TARGETS = (
    Target(name="manifest", corpus=_data_set, damaged=damaged_text, call=_load),
    Target(name="specification", corpus=_profiles, damaged=damaged_text, call=_simulate),
    Target(
        name="arrays",
        corpus=fuzz_arrays.corpus,
        damaged=fuzz_arrays.damaged,
        call=fuzz_arrays.call,
    ),
    Target(
        name="shard",
        corpus=fuzz_shards.corpus,
        damaged=fuzz_shards.damaged,
        call=fuzz_shards.read,
    ),
    *(Target(**one) for one in READERS),
)
