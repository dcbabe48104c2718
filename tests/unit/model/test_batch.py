"""Batches: declared fields, fields that are computed at their first use, cached results."""

import dataclasses
import gc
import importlib
import inspect
import pickle
import pkgutil
import weakref
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, get_args

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.support.cases import Track, case

import overtaking
import overtaking as ot
from overtaking.core import arrays
from overtaking.model.batch import (
    AxisEnd,
    Batch,
    ColumnName,
    Delayed,
    FieldSpec,
    batch_fields,
    cached_per_batch,
)
from overtaking.model.trajectories import BYTES_PER_STATE, STATE_DTYPES

TEXTS = {"Comparison"}
"""Batches with texts, whose dtype depends on their length; only this package makes them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Example(Batch):
    """A batch with each form of annotation."""

    speed: arrays.F32
    lane: Annotated[arrays.U8, FieldSpec(low=0, high=3)]
    preset: Annotated[arrays.I64 | None, FieldSpec(axes=("simulation", 2))] = None
    is_braking: arrays.Mask | None = None
    name: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Undeclared(Batch):
    """A batch whose array states no dtype."""

    speed: NDArray[np.float32]


def batch_classes(cls: type = Batch) -> Iterator[type]:
    for subclass in cls.__subclasses__():
        if dataclasses.is_dataclass(subclass) and subclass.__module__.startswith("overtaking."):
            yield subclass
        yield from batch_classes(subclass)


def import_every_module():
    for module in pkgutil.walk_packages(overtaking.__path__, "overtaking."):
        if not module.name.startswith(("overtaking.gym", "overtaking.__main__")):
            importlib.import_module(module.name)


@pytest.mark.parametrize(
    ("field", "dtype", "is_optional", "axes"),
    [
        ("speed", np.float32, False, ("simulation",)),
        ("lane", np.uint8, False, ("simulation",)),
        ("preset", np.int64, True, ("simulation", 2)),
        ("is_braking", np.bool_, True, ("simulation",)),
        ("name", None, False, ("simulation",)),
    ],
)
def test_a_field_declares_dtype_and_axes(field, dtype, is_optional, axes):
    declared = batch_fields(Example)[field]
    assert declared.dtype == (dtype and np.dtype(dtype))
    assert (declared.is_optional, declared.axes) == (is_optional, axes)


def test_a_column_is_named_after_its_field():
    assert batch_fields(Example)["lane"].column == "lane"
    assert ColumnName(prefix="ego_").for_field("speed") == "ego_speed"
    assert ColumnName("DN").for_field("night") == "DN"


def test_a_range_that_ends_with_an_axis_has_no_limits():
    with pytest.raises(TypeError, match="depends on the axis lane"):
        _ = FieldSpec(low=0, high=AxisEnd("lane")).limits


def test_a_declaration_shows_only_what_it_declares():
    assert repr(FieldSpec("gap", "m", low=0.0)) == "FieldSpec(meaning='gap', unit='m', low=0.0)"
    assert "FieldSpec(low=0, high=100000000)" in str(inspect.signature(ot.sample))


def test_every_array_type_declares_the_dtype_that_it_names():
    for name in ("F64", "I16", "I32", "I64", "U8", "U32", "U64", "Mask", "IndexArray"):
        array_type, dtype = get_args(getattr(arrays, name))
        assert array_type == NDArray[dtype.type], name
    assert get_args(arrays.F32)[1] == np.dtype(np.float32)


def test_an_array_without_a_dtype_is_refused():
    with pytest.raises(TypeError, match=r"Undeclared\.speed: expected an array type of core"):
        batch_fields(Undeclared)


@pytest.mark.ci
def test_every_array_of_every_batch_declares_its_dtype():
    import_every_module()
    classes = list(batch_classes())
    assert len(classes) > 20
    for cls in classes:
        if cls.__name__ not in TEXTS:
            declared = [field.name for field in dataclasses.fields(cls) if field.compare]
            assert list(batch_fields(cls)) == declared


def test_recorded_states_have_the_dtypes_of_the_format():
    assert {name: np.dtype(kind).str for name, kind in STATE_DTYPES.items()} == {
        **dict.fromkeys(("x", "y", "s", "d", "speed"), "<i4"),
        **dict.fromkeys(("heading", "wheel_angle", "accel_lon", "accel_lat", "yaw_rate"), "<i2"),
        "lane": "|u1",
        "lights": "|u1",
    }
    assert BYTES_PER_STATE == 32


def test_help_lists_the_fields_under_one_heading():
    """Python 3.13 removes the indentation of docstrings, earlier versions keep it."""
    lines = (inspect.getdoc(ot.DriverTraits) or "").splitlines()
    assert "    time_gap: Desired time gap behind a leader, bumper to bumper [s]." in lines
    assert lines.count("Attributes:") == 1


@dataclass(frozen=True, slots=True, kw_only=True)
class GapSignals(Delayed):
    """A batch that computes gap and time gap at their first use."""

    speed: np.ndarray
    gap: np.ndarray
    time_gap: np.ndarray


@pytest.fixture
def computed_names() -> list[str]:
    return []


@pytest.fixture
def gap_signals(computed_names: list[str]) -> GapSignals:
    def compute_gaps() -> dict[str, np.ndarray]:
        computed_names.append("gap and time_gap")
        return {"gap": np.arange(4), "time_gap": np.arange(4) * 3}

    return GapSignals.partly({"gap": compute_gaps, "time_gap": compute_gaps}, speed=np.ones(4))


def test_a_delayed_field_is_computed_once_at_its_first_use(gap_signals, computed_names):
    assert gap_signals.speed.sum() == 4
    assert computed_names == []
    sums = (gap_signals.gap.sum(), gap_signals.time_gap.sum(), gap_signals.gap.sum())
    assert sums == (6, 18, 6)
    assert computed_names == ["gap and time_gap"]


def test_a_changed_copy_of_a_delayed_batch_has_all_fields(gap_signals):
    changed = gap_signals.replace(gap=np.zeros(4))
    assert (changed.gap.sum(), changed.time_gap.sum()) == (0, 18)


def test_a_selection_and_a_pickled_copy_of_a_delayed_batch_have_all_fields(gap_signals):
    assert gap_signals.select(np.array([3])).time_gap.tolist() == [9]
    assert pickle.loads(pickle.dumps(gap_signals)).gap.tolist() == [0, 1, 2, 3]


def test_a_delayed_batch_has_no_other_attributes(gap_signals):
    with pytest.raises(AttributeError, match="closing_speed"):
        _ = gap_signals.closing_speed


def test_a_cached_function_computes_once_for_each_batch():
    calls = []
    cached = cached_per_batch(lambda batch: calls.append(batch) or len(calls))
    first, second = (case(Track(), Track(s=50.0)) for _ in range(2))
    assert [cached(first), cached(first), cached(second), cached(first)] == [1, 1, 2, 1]


def test_a_cached_result_is_released_with_its_batch():
    class Result:
        pass

    cached, batch = cached_per_batch(lambda _: Result()), case(Track(), Track(s=50.0))
    result = weakref.ref(cached(batch))
    assert result() is not None
    del batch
    gc.collect()
    assert result() is None
