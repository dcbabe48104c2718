"""The tools check what they are meant to check, with the versions that the lock files name."""

from __future__ import annotations

import json
import re
import tomllib
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from pathlib import Path

LOCKS = ("runtime", "demo", "dev", "rl", "qc", "pip")
ADDRESS = re.compile(r"://|--(?:extra-)?index-url|--find-links| @ ")
PIN = re.compile(r"^([a-z0-9._-]+)==(\S+)(?: ; (.*?))? \\$", re.MULTILINE)


@pytest.fixture(scope="module")
def project(repository: Path) -> dict[str, Any]:
    return tomllib.loads((repository / "pyproject.toml").read_text(encoding="utf-8"))


def lock(repository: Path, name: str) -> str:
    return (repository / "requirements" / f"{name}.txt").read_text(encoding="utf-8")


def names(requirements: list[str]) -> set[str]:
    """The packages of requirements such as `pyright[nodejs]>=1.1`."""
    found = (re.match(r"[a-z0-9._-]+", requirement) for requirement in requirements)
    return {match.group() for match in found if match}


def pins(repository: Path, name: str) -> set[tuple[str, ...]]:
    """Every (package, version, marker) of a lock file."""
    return set(PIN.findall(lock(repository, name)))


@pytest.mark.parametrize("name", LOCKS)
def test_a_lock_file_names_no_address(name: str, repository: Path):
    assert ADDRESS.findall(lock(repository, name)) == []


@pytest.mark.parametrize("name", LOCKS)
def test_a_lock_file_has_a_hash_for_every_version(name: str, repository: Path):
    text = lock(repository, name)
    entries = re.split(r"^(?=[a-z0-9])", text, flags=re.MULTILINE)[1:]
    assert len(entries) == len(pins(repository, name))
    assert all("--hash=sha256:" in entry for entry in entries)


def test_the_lock_file_of_the_page_has_hashes_and_no_address(repository: Path):
    text = (repository / "viewer" / "package-lock.json").read_text(encoding="utf-8")
    packages = json.loads(text)["packages"]
    assert ADDRESS.findall(text) == []
    assert "resolved" not in text
    assert all("integrity" in one for name, one in packages.items() if name)


def test_all_lock_files_agree_on_versions(repository: Path):
    # The checkers of ASAM want another NumPy: qc stands apart, and pip is alone.
    runtime, demo, dev, rl, *_ = (pins(repository, name) for name in LOCKS)

    def versions(lines: set[tuple[str, ...]]) -> set[tuple[str, ...]]:
        return {line[:2] for line in lines}

    assert versions(runtime) <= versions(demo) <= versions(dev)
    known = {line[0] for line in versions(dev)}
    assert {line for line in versions(rl) if line[0] in known} <= versions(dev)


def test_the_locks_hold_every_package_that_the_project_asks_for(
    project: dict[str, Any], repository: Path
):
    groups = project["dependency-groups"]
    tools = names([*groups["build"], *groups["lint"], *groups["test"]])
    extras = project["project"]["optional-dependencies"]
    groups_of_extras = ("all", "common")
    optional = names(
        [
            requirement
            for name, requirements in extras.items()
            if name not in groups_of_extras
            for requirement in requirements
        ]
    )
    runtime = names(project["project"]["dependencies"])
    demo_extras = names(
        [requirement for name in ("plots", "stats", "video") for requirement in extras[name]]
    )
    packages_of_lock = {
        "runtime": runtime,
        "demo": runtime | names(groups["build"]) | demo_extras,
        "dev": runtime | tools | optional,
        "rl": runtime | names([*groups["rl"], *extras["gym"]]),
        "qc": names(groups["qc"]),
        "pip": names(groups["pip"]),
    }
    for name, packages in packages_of_lock.items():
        locked = {pin[0] for pin in pins(repository, name)}
        assert packages - locked == set(), f'requirements/{name}.txt is older; run "make lock"'


def test_every_configured_path_exists(project: dict[str, Any], repository: Path):
    """A tool that is given a path that does not exist checks nothing and is content."""
    tools = project["tool"]
    paths = {
        *tools["pyright"]["include"],
        *(place["root"] for place in tools["pyright"]["executionEnvironments"]),
        *tools["ruff"]["src"],
        *tools["pytest"]["ini_options"]["testpaths"],
        tools["maturin"]["manifest-path"],
        tools["maturin"]["python-source"],
    }
    assert {path for path in paths if not (repository / path).exists()} == set()
