"""Errors and their messages; checks of names, numbers and extras."""

from __future__ import annotations

import math
import pickle
import re
import shlex
import subprocess
import sys
import tomllib
from typing import TYPE_CHECKING

import pytest
from tests.support.integers import INTEGER_TYPES, NO_INTEGERS

from overtaking.core import errors
from overtaking.core.errors import (
    ConfigError,
    MissingExtraError,
    check_choice,
    check_extra,
    check_in_range,
    check_whole_number,
    extra_groups,
    extra_requirements,
    install_command,
    whole_number,
)
from overtaking.core.errors import requirements as requirements_of_package

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


KINDS = [
    (errors.ConfigError, ValueError),
    (errors.NoSuchSimulationError, errors.ConfigError),
    (errors.NoSuchSimulationError, IndexError),
    (errors.SchemaError, ValueError),
    (errors.DriverError, RuntimeError),
    (errors.ImportFormatError, ValueError),
    (errors.DatasetError, RuntimeError),
    (errors.LockedError, errors.DatasetError),
    (errors.SystemLimitError, RuntimeError),
    (errors.MissingExtraError, ImportError),
    (errors.KnowledgeError, ValueError),
    (errors.InfeasibleError, ValueError),
]


def example(kind: type[errors.OvertakingError], **changes: object) -> errors.OvertakingError:
    parts: dict[str, object] = {
        "what": "column v_mps",
        "where": "states.parquet",
        "expected": "float32",
        "got": "float64",
        "next_step": 'run "overtaking migrate"',
    }
    return kind(**(parts | changes))


@pytest.mark.parametrize(("kind", "builtin"), KINDS)
def test_every_error_is_ours_and_also_a_built_in_kind(
    kind: type[errors.OvertakingError], builtin: type[Exception]
):
    with pytest.raises(builtin, match="column v_mps") as caught:
        raise example(kind)
    assert type(caught.value) is kind
    assert isinstance(caught.value, errors.OvertakingError)


def test_no_error_of_the_module_is_left_out_of_the_table():
    ours = {
        item
        for item in vars(errors).values()
        if isinstance(item, type) and issubclass(item, errors.OvertakingError)
    }
    assert ours == {kind for kind, _ in KINDS} | {errors.OvertakingError}


def test_a_message_says_where_what_expected_got_and_next_step_in_this_order():
    message = str(example(errors.SchemaError))
    assert message == (
        'states.parquet: column v_mps: expected float32, got float64; run "overtaking migrate"'
    )


def test_a_message_is_one_line_whatever_its_parts_hold():
    message = str(example(errors.ConfigError, got="a\nb\r\n\tc", where="x\ny"))
    assert message.splitlines() == [message]
    assert "got a b c;" in message
    assert message.startswith("x y: ")


def test_a_terminal_obeys_nothing_in_a_message():
    message = str(example(errors.ConfigError, got="\x1b[2Ja\u202eb\x00"))
    assert message.isprintable()
    assert "got �[2Ja�b�;" in message


def test_a_value_that_is_no_text_is_shown_as_python_writes_it():
    assert "got None;" in str(example(errors.ConfigError, got=None))
    assert "expected 3.5, got ['a', 1];" in str(
        example(errors.ConfigError, expected=3.5, got=["a", 1])
    )


def test_a_huge_value_does_not_flood_the_message():
    message = str(example(errors.ConfigError, got=list(range(10_000))))
    assert len(message) < 400
    assert "..." in message


@pytest.mark.parametrize("missing", ["what", "where", "expected", "got"])
def test_a_message_needs_all_parts_but_the_next_step(missing: str):
    parts: dict[str, object] = {"what": "a", "where": "b", "expected": "c", "got": "d"}
    del parts[missing]
    with pytest.raises(TypeError, match=missing):
        errors.ConfigError(**parts)


def test_the_default_next_step_is_to_correct_the_value():
    error = errors.ConfigError(what="a", where="b", expected="c", got="d")
    assert str(error) == "b: a: expected c, got d; correct it"


@pytest.mark.parametrize("kind", [errors.OvertakingError, *dict(KINDS)])
def test_pickling_keeps_the_class_and_the_message(kind: type[errors.OvertakingError]):
    error = example(kind)
    restored = pickle.loads(pickle.dumps(error))
    assert type(restored) is kind
    assert str(restored) == str(error)
    assert restored.args == error.args


def test_a_name_that_is_unknown_comes_with_those_that_are_known():
    error = errors.ConfigError.unknown_choice(
        what="policy", where="stats", choices=("paper", "strict"), got="papr"
    )
    expected = "stats: policy: expected paper or strict, got papr; choose one of them"
    assert str(error) == expected


@pytest.mark.parametrize(
    ("high", "next_step", "expected"),
    [
        (9, "", "label: rows: expected 1 to 9, got 0; choose a number in that range"),
        (None, "ask for more", "label: rows: expected 1 or more, got 0; ask for more"),
    ],
)
def test_a_number_out_of_its_range_comes_with_the_range(high, next_step, expected):
    error = errors.ConfigError.out_of_range(
        what="rows", where="label", low=1, high=high, got=0, next_step=next_step
    )
    assert str(error) == expected


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    check_choice("svg", ("svg", "png"), what="--format", where="draw")
    with pytest.raises(ConfigError, match=r"^draw: --format: expected svg or png, got gif; choose"):
        check_choice("gif", ("svg", "png"), what="--format", where="draw")


@pytest.mark.parametrize("number", [0, -1, math.nan])
def test_a_number_that_is_too_small_is_refused(number: float) -> None:
    check_in_range(1, 1, what="--every", where="logic")
    with pytest.raises(ConfigError, match=r"^logic: --every: expected 1 frame or more, got"):
        check_in_range(number, 1, what="--every", where="logic", unit="frame")


@pytest.mark.parametrize("kind", INTEGER_TYPES)
def test_an_integer_of_any_library_becomes_one_of_python(kind: str) -> None:
    number = whole_number(INTEGER_TYPES[kind](7))
    assert (number, type(number)) == (7, int)
    assert check_whole_number(INTEGER_TYPES[kind](7), 7, 7, what="seed", where="sample") == 7


@pytest.mark.parametrize("value", [*NO_INTEGERS, None])
def test_a_flag_or_a_fraction_is_no_integer(value: object) -> None:
    assert whole_number(value) is None
    with pytest.raises(ConfigError, match=r"^sample: seed: expected 0 to 9, got"):
        check_whole_number(value, 0, 9, what="seed", where="sample")


@pytest.mark.parametrize("number", [-1, 10, 2**70])
def test_an_integer_out_of_its_range_is_refused(number: int) -> None:
    with pytest.raises(ConfigError, match=r"^sample: seed: expected 0 to 9, got"):
        check_whole_number(number, 0, 9, what="seed", where="sample")


def declared(repository: Path) -> dict[str, list[str]]:
    """The extras of the project file, without what markers say."""
    text = (repository / "pyproject.toml").read_text(encoding="utf-8")
    given = tomllib.loads(text)["project"]["optional-dependencies"]
    return {
        name: [one.partition(";")[0] for one in requirements]
        for name, requirements in given.items()
        if not requirements[0].startswith("overtaking[")
    }


def test_every_extra_is_known_with_its_requirements(repository: Path):
    assert {name: list(of) for name, of in extra_requirements().items()} == declared(repository)


def test_the_command_installs_packages_of_an_index_for_the_interpreter_that_runs(
    repository: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    monkeypatch.chdir(tmp_path)
    for name, requirements in declared(repository).items():
        python, *words = shlex.split(install_command(name))
        assert python == sys.executable
        assert words == ["-m", "pip", "install", *requirements]
    monkeypatch.setattr(sys, "executable", str(tmp_path / ".venv" / "bin" / "python"))
    assert install_command("sql") == ".venv/bin/python -m pip install 'duckdb>=1.1'"


def test_groups_of_extras_are_read_from_the_metadata(monkeypatch: pytest.MonkeyPatch):
    lines = [
        "duckdb>=1.1 ; extra == 'sql'",
        "scipy>=1.13 ; extra == 'stats'",
        "overtaking[stats,sql] ; extra == 'common'",
    ]
    monkeypatch.setattr("importlib.metadata.requires", lambda _: lines)
    for function in (requirements_of_package, extra_requirements, extra_groups):
        function.cache_clear()
    try:
        assert extra_groups() == {"common": ("sql", "stats")}
        assert extra_requirements() == {"sql": ("duckdb>=1.1",), "stats": ("scipy>=1.13",)}
        assert shlex.split(install_command("common"))[-2:] == ["duckdb>=1.1", "scipy>=1.13"]
    finally:
        for function in (requirements_of_package, extra_requirements, extra_groups):
            function.cache_clear()


def test_the_extra_common_lacks_the_simulators_and_ray(repository: Path):
    text = (repository / "pyproject.toml").read_text(encoding="utf-8")
    groups = tomllib.loads(text)["project"]["optional-dependencies"]
    (common,), (all_extras,) = (
        re.findall(r"^overtaking\[(.*)\]$", groups[name][0]) for name in ("common", "all")
    )
    left_out = set(all_extras.split(",")) - set(common.split(","))
    assert left_out == {"carla", "cloud", "onnx", "ray", "sumo"}
    assert set(common.split(",")) <= set(all_extras.split(","))
    readme = (repository / "README.md").read_text(encoding="utf-8")
    assert "python -m pip install '.[common]'" in readme


def test_the_error_ends_in_the_command():
    error = MissingExtraError.for_extra("sql", what="DuckDB", where="sql")
    told = f"sql: DuckDB: expected the extra [sql], got none; run: {install_command('sql')}"
    assert str(error) == told


def test_a_call_without_its_extra_is_refused(monkeypatch: pytest.MonkeyPatch):
    check_extra("sql", "json", what="DuckDB", where="sql")
    monkeypatch.setitem(sys.modules, "duckdb", None)
    with pytest.raises(MissingExtraError) as caught:
        check_extra("sql", "json", "duckdb", what="DuckDB", where="sql", otherwise="use pandas")
    assert str(caught.value).endswith(f"; run: {install_command('sql')}; or use pandas")


def sources(repository: Path) -> Iterator[Path]:
    yield from repository.glob("*.md")
    for folder, kind in (("docs", "*.md"), ("src", "*.py"), ("examples", "*.py")):
        yield from (repository / folder).rglob(kind)


def test_nothing_tells_to_install_the_package_from_an_index(repository: Path):
    told = r"pip install [^\n]*\bovertaking\b"
    assert [path for path in sources(repository) if re.search(told, path.read_text("utf-8"))] == []


@pytest.mark.ci
def test_pip_takes_what_the_commands_name():
    """It reads all requirements before it looks for the first."""
    commands = [shlex.split(install_command(name)) for name in extra_requirements()]
    requirements = [word for _, _, _, _, *words in commands for word in words]
    command = [sys.executable, "-m", "pip", "install", *requirements]
    bounds = ["--dry-run", "--no-index", "--no-deps", "--quiet"]
    done = subprocess.run([*command, *bounds], capture_output=True, text=True, check=False)
    assert "Invalid requirement" not in done.stderr
