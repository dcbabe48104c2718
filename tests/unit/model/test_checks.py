"""What comes from outside is held to what fields and arguments declare, by one check for all."""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Iterable, Mapping  # noqa: TC003 - `checked` reads annotations.
from pathlib import Path  # noqa: TC003
from typing import TYPE_CHECKING, Annotated

import numpy as np
import pytest

import overtaking as ot
from overtaking.core.errors import ConfigError, SystemLimitError
from overtaking.model.batch import FieldSpec, batch_fields
from overtaking.model.checks import check_arguments, check_batch
from overtaking.model.overtake_features import PaperFeatures
from overtaking.model.safety_measures import SafetyMeasures
from overtaking.scenarios.profiles import profile_names

if TYPE_CHECKING:
    from overtaking.model.batch import Batch

pytestmark = pytest.mark.ci

SHORT = {"time.horizon_s": 2.0, "time.attempt_deadline_s": 1.0}


@pytest.fixture(scope="module")
def scenario() -> ot.Scenario:
    return ot.sample("pinto2023-physical", num_simulations=3, seed=1, overrides=SHORT)


@pytest.fixture(scope="module")
def runs(scenario: ot.Scenario) -> ot.Trajectories:
    return ot.simulate(scenario)


def changed(batch: Batch, path: str, value: object) -> Batch:
    """A batch in which one place of a field has another value, or a field is something else."""
    name, _, rest = path.partition(".")
    inner = getattr(batch, name)
    if rest:
        return batch.replace(**{name: changed(inner, rest, value)})
    if isinstance(inner, np.ndarray) and np.isscalar(value) and not isinstance(value, str):
        copy = inner.copy()
        copy[(1, 0, 2)[: copy.ndim]] = value
        return batch.replace(**{name: copy})
    return batch.replace(**{name: value})


def refused(text: str):
    return pytest.raises(ConfigError, match=rf"\A{re.escape(text)}[^\n]*\Z")


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        ("start_speed", np.nan, "expected 0 to 150 m/s, got nan in simulation 1, vehicle 0"),
        ("start_lane", 9, "expected 0 to 4, got 9 in simulation 1, vehicle 0"),
        ("start_s", 9e4, "expected at most "),
        ("vehicles.mass", -1.0, "expected 20 to 200000 kg, got -1 in simulation 1, vehicle 0"),
        ("vehicles.cg_to_front", 9.0, "expected less than the wheelbase, got 9 in simulation 1"),
        ("vehicles.valid", False, "expected True for the ego in slot 0, and no True after a False"),
        ("vehicles.kind", 7, "expected 0 to 6, got 7 in"),
        ("drivers.caution", 1.5, "expected 0 to 1, got 1.5 in"),
        ("weather.rain", 500.0, "expected 0 to 100 %, got 500 in simulation 1"),
        ("weather.preset", 200, "expected 0 to 21, or 255, got 200 in simulation 1"),
        ("horizon", np.inf, "expected more than 0 and at most 6000 s, got inf in simulation 1"),
        ("weight", -1.0, "expected 0 to 1e+12, got -1 in simulation 1"),
        ("seed", -1, "expected 0 to 18446744073709551615, got -1"),
        ("seed", "1", "expected a whole number, got '1'"),
        ("road", "town06", "expected a Road, got 'town06'"),
        ("weather", None, "expected a Weather, got None"),
        ("start_s", [1.0], "expected an array of float32 with the axes (simulation, vehicle), got"),
        ("start_s", np.ones((3, 6)), "expected an array of float32"),
        ("start_s", np.ones(3, np.float32), "expected an array of float32"),
        (
            "start_s",
            np.ones((2, 6), np.float32),
            "expected length 3 along simulation, as scenario.scenario_index has",
        ),
    ],
)
def test_a_scenario_that_is_none_is_refused(scenario, path: str, value: object, says: str):
    with refused(f"simulate: scenario.{path}: {says}"):
        ot.simulate(changed(scenario, path, value))


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        ("num_frames", 42, "expected 1 to 41, as stage has, got 42 in simulation 1"),
        ("num_frames", 0, "expected 1 to 41, as stage has, got 0 in simulation 1"),
        ("states.lane", 9, "expected 0 to 5, or 255, got 9 in simulation 1, vehicle 0, time 2"),
        ("states.speed", -1, "expected 0 to 1000000 mm/s, got -1 in"),
        ("stage", 7, "expected 0 to 6, got 7 in simulation 1, time 0"),
        ("contacts.partner", 6, "expected 0 to 5, or 255, got 6 in simulation 1, vehicle 0"),
        ("unknown", frozenset({"colour"}), "expected names among weather, drivers"),
        ("scenario.weather.fog", -1.0, "expected 0 to 100 %, got -1 in simulation 1"),
        ("is_recorded", np.ones((3, 6, 41)), "expected an array of bool with the axes"),
        ("trace_hash", np.ones((3, 5), np.uint32), "expected length 4 along 4, got 5"),
    ],
)
def test_a_recording_that_is_none_is_refused(runs, path: str, value: object, says: str):
    with refused(f"label: trajectories.{path}: {says}"):
        ot.label(changed(runs, path, value))


@pytest.mark.parametrize("profile", profile_names())
def test_what_profiles_and_simulators_make_passes(profile: str):
    check_batch(ot.sample(profile, num_simulations=500, seed=3), "test")
    short = ot.sample(profile, num_simulations=5, seed=3, overrides=SHORT)
    for simulator in ("engine", "reference"):
        check_batch(ot.simulate(short, simulator=simulator), "test")


def test_a_recording_of_others_passes(shared_data, tmp_path: Path):
    for name in ("C-DEU_MONAMerge-2_480_T-559", "OSC_CutIn-1_2_T-1"):
        source = shared_data / "commonroad" / f"{name}.xml"
        data = ot.import_recording("commonroad", source, tmp_path / name)
        for _, batch in data.batches():
            check_batch(batch, "test")


def test_a_batch_without_simulations_passes(scenario):
    check_batch(scenario.select(slice(0, 0)), "test")


def test_what_a_recording_may_have_and_a_simulator_cannot_run_is_refused(scenario):
    with refused("simulate: scenario.frame_interval_ms: expected a multiple of 10, got 33"):
        ot.simulate(scenario.replace(frame_interval_ms=33))


def test_more_than_memory_holds_is_refused(scenario, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(os, "sysconf", {"SC_PAGE_SIZE": 1024, "SC_PHYS_PAGES": 20}.__getitem__)
    with pytest.raises(
        SystemLimitError, match=r"^sample: memory: expected at most the 0 MB of this"
    ):
        ot.sample("pinto2023-physical", num_simulations=10**8, seed=1)
    with pytest.raises(
        SystemLimitError, match=r"^simulate: memory: expected at most the 0 MB of this"
    ):
        ot.simulate(scenario)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda _: ot.simulate(5), "simulate: scenario: expected a Scenario, got 5"),
        (lambda s: ot.label(s), "label: trajectories: expected a Trajectories, got a Scenario"),
        (
            lambda _: ot.sample("pinto2023-physical", num_simulations=-1, seed=1),
            "sample: num_simulations: expected 0 to 100000000",
        ),
        (
            lambda _: ot.sample("pinto2023-physical", num_simulations="a", seed=1),
            "sample: num_simulations: expected a whole number",
        ),
        (
            lambda _: ot.sample("pinto2023-physical", num_simulations=1, seed=2**64),
            "sample: seed: expected 0 to 184467440737095",
        ),
        (
            lambda _: ot.sample("pinto2023-physical", num_simulations=True, seed=1),
            "sample: num_simulations: expected a whole number",
        ),
        (lambda s: ot.branch(s, 10**6), "branch: frame: expected 0 to 40, "),
        (
            lambda s: ot.branch(s, 3, decision=7),
            "branch: decision: expected a ForcedDecision or None",
        ),
        (
            lambda s: ot.branch(s, 3, weather=s.weather.select(slice(0, 2))),
            "branch: weather.preset: expected length 3 along simulation, as scenario_index has, "
            "got 2",
        ),
        (
            lambda _: ot.load_dataset(5),
            "load_dataset: path: expected a text, a path or a Dataset, got 5",
        ),
        (
            lambda _: ot.load_dataset("\0"),
            "load_dataset: path: expected a text, a path or a Dataset, got '\\x00'",
        ),
        (
            lambda _: ot.compare_simulators(
                "pinto2023-physical", num_simulations=1, seed=1, simulators="engine"
            ),
            "compare_simulators: simulators: expected several values, each of them a text, "
            "got 'engine'",
        ),
        (
            lambda _: ot.film(5),
            "film: source: expected a data set, trajectories, what label returned, or a Twin, "
            "got an object of type int",
        ),
        (lambda _: ot.plot(1), "plot: source: expected a data set"),
        (
            lambda _: ot.ClassBalance(candidates="a"),
            "balance: candidates: expected a whole number or N",
        ),
        (lambda _: ot.ClassBalance(by="class"), "balance: by: expected several values"),
        (lambda s: s.select(1), "Scenario.select: simulations: expected a slice, a mask or"),
        (lambda s: s.select(np.array([3])), "Scenario.select: simulations: expected a slice"),
        (lambda s: s.replace(speed=3), "Scenario.replace: field: expected profile or road"),
    ],
)
def test_arguments_of_another_type_or_range_are_refused_in_a_line(scenario, call, says: str):
    with refused(says):
        call(scenario)


def test_methods_of_a_data_set_check_their_arguments(tmp_path: Path):
    data = ot.generate_dataset(
        "pinto2023-physical", num_simulations=2, seed=1, out=tmp_path / "data", overrides=SHORT
    )
    for call in (data.states, data.trajectory, data.verdict, data.__getitem__):
        with pytest.raises(ConfigError, match="simulation: expected a whole number, got 'a'"):
            call("a")  # type: ignore[arg-type]
    with refused("Dataset.table: name: expected a text, got 5"):
        data.table(5)  # type: ignore[arg-type]


@check_arguments
def example(
    number: Annotated[int, FieldSpec(low=1, high=9)],
    names: Iterable[str] = (),
    *,
    size: tuple[int, int] = (1, 2),
    table: Mapping[str, float] | None = None,
    **others: object,
) -> tuple[object, ...]:
    """Return what it is given."""
    return number, names, size, table, others


def test_good_arguments_arrive_as_they_are_and_iterables_as_tuples():
    assert example(np.int64(3)) == (3, (), (1, 2), None, {})
    given = example(3, iter("ab"), size=(4, 5), table={"a": 1.0}, more=4)
    assert given == (3, ("a", "b"), (4, 5), {"a": 1.0}, {"more": 4})


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"number": 0}, "number: expected 1 to 9, got 0"),
        ({"number": 1.0}, "number: expected a whole number, got 1.0"),
        ({"number": None}, "number: expected a whole number, got None"),
        ({"number": 1, "names": "ab"}, "names: expected several values, each of them a text"),
        ({"number": 1, "names": [1]}, "names: expected several values, each of them a text"),
        ({"number": 1, "names": np.array("a")}, "names: expected several values"),
        ({"number": 1, "size": (1, 2, 3)}, "size: expected several values, each of them a whole"),
        ({"number": 1, "table": {1: 2}}, "table: expected a Mapping whose keys are each a text or"),
    ],
)
def test_other_arguments_are_refused(arguments, says: str):
    with refused(f"example: {says}"):
        example(**arguments)


def test_a_checked_function_keeps_its_name_and_words():
    assert (example.__name__, example.__doc__) == ("example", "Return what it is given.")


@pytest.mark.parametrize("cls", [ot.Scenario, ot.Weather, ot.VehicleSpecs, ot.DriverTraits])
def test_every_number_of_what_is_simulated_has_a_range(cls: type):
    declared = batch_fields(cls)
    without = {
        field.name
        for field in dataclasses.fields(cls)
        if "float" in str(field.type) and not declared[field.name].spec.is_bounded
    }
    assert without == set()


def test_help_lists_what_the_fields_declare():
    line = "time_gap: Desired time gap behind a leader, bumper to bumper [s].\n"
    assert line in (ot.DriverTraits.__doc__ or "")


@pytest.mark.parametrize(
    "cls", [ot.Weather, ot.VehicleSpecs, ot.DriverTraits, SafetyMeasures, PaperFeatures]
)
def test_every_field_is_declared_with_its_meaning(cls: type):
    declared = batch_fields(cls)
    assert [name for name, field in declared.items() if not field.spec.meaning] == []
    assert declared.keys() == cls.__dataclass_fields__.keys()
