"""What becomes of public functions that are given arrays and arguments with something wrong.

`corpus` makes sound calls, `damaged` puts something wrong into one of them, and `call` carries it
out: an `OvertakingError` may come of it, or a recording that is whole and can be labelled.
"""

import dataclasses
import random
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import overtaking as ot
from overtaking.core.errors import ConfigError
from overtaking.model.batch import AxisEnd, Batch, FieldSpec, batch_fields
from overtaking.model.checks import check_batch

Call = tuple[str, dict[str, Any]]
"""A function, or a method of the data set, and its arguments."""

SHORT = {"time.horizon_s": 2.0, "time.attempt_deadline_s": 1.0}
MANY, MOST = ("simulations", "shard_size"), 7
LONGEST_S = 20.0  # Within its range a horizon may ask for gigabytes.
HOSTILE = (
    *(0, 1, -1, 7, 255, 256, 10**6, -(2**31), 2**63, 2**64, 10**30),
    *(0.0, -0.0, 0.5, 1e-40, -1e-3, 1e9, 1e38, 1e308, float("nan"), float("inf"), -float("inf")),
    *(
        None,
        True,
        "a",
        "",
        "\0",
        "../..",
        b"a",
        [],
        [1],
        {},
        (),
        {1: 2},
        object(),
        ot.ForcedDecision.CANCEL,
    ),
    *(np.float32(1), np.int64(3), np.array(2), np.array([]), np.array("a"), np.zeros((2, 2, 2))),
    *("é" * 5000, Path("/dev/null"), Path("/nowhere"), range(3), iter([1, "a"]), print, int, ot),
)


def corpus(folder: Path) -> Sequence[Call]:
    """Sound calls."""
    placed = ot.sample("pinto2023-physical", num_simulations=3, seed=1, overrides=SHORT)
    flow = ot.sample(
        "motorway", num_simulations=2, seed=1, overrides=SHORT | {"time.attempt_deadline_s": 2.0}
    )
    ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=4,
        seed=1,
        out=folder / "data",
        overrides=SHORT,
        keep="features",
    )
    data = ot.load_dataset(folder / "data")
    batches: list[Call] = []
    for scenario in (placed, flow):
        changed = {"frame": 10, "decision": ot.ForcedDecision.PULL_OUT, "weather": scenario.weather}
        batches += [
            ("simulate", {"scenario": scenario}),
            ("simulate", {"scenario": scenario}),
            ("label", {"trajectories": ot.simulate(scenario)}),
            ("branch", {"source": scenario, **changed}),
        ]
    given = {
        "profile": "pinto2023-physical",
        "num_simulations": 2,
        "seed": 1,
        "overrides": dict(SHORT),
    }
    one = {"simulation": 1}
    plain: list[Call] = [
        ("sample", {**given, "first_scenario": 5, "road": "town06"}),
        # One simulator alone is refused: the readable one would take minutes.
        ("compare_simulators", {**given, "simulators": ("engine",), "progress": None}),
        ("generate_dataset", {**given, "out": folder / "other", "resume": True, "shard_size": 2}),
        (
            "dataset_statistics",
            {"dataset": data, "policy": "paper", "reading": "paper", "weighted": False},
        ),
        ("load_dataset", {"path": folder / "data"}),
        ("Dataset.states", {"self": data, **one}),
        ("Dataset.trajectory", {"self": data, **one}),
        ("Dataset.verdict", {"self": data, **one}),
        ("Dataset.__getitem__", {"self": data, **one}),
        ("Dataset.table", {"self": data, "name": "labels"}),
        ("Dataset.features", {"self": data, "policy": "paper", "encoded": True}),
        ("ClassBalance", {"by": ("class",), "policy": "paper", "candidates": 10}),
        ("Road", _fields(placed.road)),
        ("Lane", _fields(placed.road.lanes[0])),
        ("Scenario.select", {"self": placed, "simulations": np.array([1])}),
        ("Scenario.replace", {"self": placed, "seed": 3}),
    ]
    return [*batches, *batches, *plain]


def damaged(sound: Call, chance: random.Random) -> Call:
    """The call with one to three things wrong."""
    name, given = sound[0], dict(sound[1])
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        key = chance.choice([one for one in given if one != "self"])
        if isinstance(given[key], Batch) and chance.random() < 0.95:
            given[key] = _damaged_batch(given[key], chance)
        else:
            given[key] = chance.choice(HOSTILE)
        if key in MANY and isinstance(given[key], int) and given[key] > 0:
            given[key] = min(given[key], MOST)  # More is no mistake, it only takes long.
    return name, given


def call(given: Call, _folder: Path) -> None:
    """Carry the call out, and look whether a simulation that was not refused is one."""
    name, arguments = given
    function: Any = ot
    for part in name.split("."):
        function = getattr(function, part)
    made = function(**arguments)
    if name in ("simulate", "branch"):
        try:
            check_batch(made, "fuzz", "runs")
            ot.label(made)
        except ConfigError as error:
            message = f"{name} made what no recording is: {error}"
            raise AssertionError(message) from error
    assert len(repr(made)) < 20_000 or name.startswith("Dataset")


def _fields(one: Any) -> dict[str, Any]:
    return {field.name: getattr(one, field.name) for field in dataclasses.fields(one)}


def _damaged_batch(batch: Batch, chance: random.Random) -> Any:
    """A batch with something wrong in one field of it, or of a batch in it."""
    field = chance.choice(dataclasses.fields(batch))  # type: ignore[arg-type]
    value = getattr(batch, field.name)
    if isinstance(value, Batch) and chance.random() < 0.95:
        return batch.replace(**{field.name: _damaged_batch(value, chance)})
    if isinstance(value, np.ndarray) and chance.random() < 0.95:
        spec = batch_fields(type(batch))[field.name].spec
        return batch.replace(**{field.name: _damaged_array(value, spec, field.name, chance)})
    return batch.replace(**{field.name: chance.choice(HOSTILE)})


def _damaged_array(array: Any, spec: FieldSpec, name: str, chance: random.Random) -> Any:
    how = chance.random()
    if how < 0.3 and spec.is_bounded and not isinstance(spec.high, AxisEnd):
        high = min(spec.high, LONGEST_S) if name == "horizon" else spec.high
        low = max(spec.low, 1e-3) if spec.low_is_open else spec.low
        ends = (low, high, chance.uniform(low, high))
        return _filled(array, chance.choice(ends), chance)
    if how < 0.7:
        with np.errstate(all="ignore"):
            return _filled(
                array, chance.choice([x for x in HOSTILE if isinstance(x, int | float)]), chance
            )
    return chance.choice(_SHAPES)(array)


def _filled(array: Any, value: Any, chance: random.Random) -> Any:
    """A copy with a value in one place, or everywhere, as far as its type can hold it."""
    copy = array.copy()
    try:
        cast = np.asarray(value).astype(array.dtype)
    except (OverflowError, ValueError, TypeError):
        cast = array.dtype.type(1)
    if copy.size and chance.random() < 0.6:
        copy.reshape(-1)[chance.randrange(copy.size)] = cast
    else:
        copy[...] = cast
    return copy


_SHAPES: tuple[Callable[[Any], Any], ...] = (
    lambda array: array.astype(np.float64),
    lambda array: array.astype(np.int64),
    lambda array: array.astype(object),
    lambda array: array.astype(str),
    lambda array: array.astype(array.dtype.newbyteorder(">")),
    lambda array: array.astype(bool),
    lambda array: array.tolist(),
    lambda array: array[:1],
    lambda array: array[:0],
    lambda array: array[..., :1],
    lambda array: array[..., :0],
    lambda array: array[None],
    lambda array: array[0],
    lambda array: array.T,
    lambda array: np.concatenate([array, array]),
    lambda array: np.asfortranarray(array),
    lambda array: array[::-1],
    lambda array: array[..., ::-1],
    lambda array: np.repeat(array, 2, axis=-1)[..., ::2],
    lambda array: np.broadcast_to(array.reshape(-1)[:1].reshape((1,) * array.ndim), array.shape),
    lambda array: np.ma.masked_array(array, mask=True),
    lambda array: array.view(np.recarray),
)
