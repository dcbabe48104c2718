"""What is said of a missing extra is true wherever the package was installed from."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tomllib
from typing import TYPE_CHECKING

import pytest

from overtaking.core.errors import (
    MissingExtraError,
    check_extra,
    extra_groups,
    extra_requirements,
    install_command,
)
from overtaking.core.errors import requirements as requirements_of_package

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


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
