"""The diagnosis says what is here, and what to do about what is not."""

from __future__ import annotations

import io
import json
import shutil
from importlib import metadata

import pytest
from rich.console import Console

from overtaking.cli import doctor
from overtaking.core.errors import Requirement, install_command, requirements


def page(values, *, encoding="utf-8", width=80) -> str:
    file = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    console = Console(file=file, width=width, highlight=False)
    console.print(doctor.render(values, console))
    file.flush()
    return file.buffer.getvalue().decode(encoding)


def test_versions_are_those_that_are_installed(tmp_path):
    values = doctor.diagnose(tmp_path)
    assert values["overtaking"] == metadata.version("overtaking")
    assert values["libraries"]["numpy"] == metadata.version("numpy")
    assert json.loads(json.dumps(values)) == values


def test_the_engine_is_loaded_and_its_level_is_one_of_those_available(tmp_path):
    engine = doctor.diagnose(tmp_path)["engine"]
    assert engine["loaded"]
    assert engine["simd"] in engine["simd_available"]


def test_every_extra_that_the_package_declares_is_listed(tmp_path):
    declared = set(metadata.metadata("overtaking").get_all("Provides-Extra") or [])
    values = doctor.diagnose(tmp_path)
    extras = values["extras"]
    assert {*extras, *values["extra_groups"]} == declared
    assert set(values["extra_groups"]["all"]["extras"]) == set(extras)
    for name, extra in extras.items():
        assert extra["packages"]
        assert extra["install"] == install_command(name)
        for package, version in extra["packages"].items():
            if version is not None:
                assert version == metadata.version(package)


def test_an_extra_that_is_missing_comes_with_the_command_that_installs_it(tmp_path, monkeypatch):
    real = metadata.version

    def version(name: str) -> str:
        if name in ("duckdb", "libsumo"):
            raise metadata.PackageNotFoundError(name)
        return real(name)

    monkeypatch.setattr(metadata, "version", version)
    values = doctor.diagnose(tmp_path)
    assert not values["extras"]["sql"]["installed"]
    assert f"duckdb missing: {install_command('sql')}" in page(values)
    assert values["extra_groups"]["all"]["missing"] == ["sql", "sumo"]
    assert values["findings"] == []  # An extra is not needed.


def test_a_library_that_is_missing_is_a_finding(tmp_path, monkeypatch):
    needed = Requirement("no-such-library", "no-such-library>=1", "")
    monkeypatch.setattr(doctor, "requirements", lambda: (*requirements(), needed))
    (finding,) = doctor.diagnose(tmp_path)["findings"]
    assert finding.startswith("no-such-library is missing; install")


def test_the_libraries_are_those_that_the_package_needs(tmp_path):
    libraries = doctor.diagnose(tmp_path)["libraries"]
    assert {"numpy", "pandas", "pyarrow", "msgpack"} <= libraries.keys()
    assert "duckdb" not in libraries


@pytest.mark.parametrize(
    ("package", "installed", "needed"),
    [
        ("matplotlib", "3.9.4", "matplotlib>=3.10"),
        ("numpy", "1.26.4", "numpy>=2"),
        ("pyarrow", "9.0.0", "pyarrow>=19.0.1"),
    ],
)
def test_a_library_that_is_too_old_is_a_finding(
    tmp_path, monkeypatch, package: str, installed: str, needed: str
):
    real, extra = metadata.version, "" if package != "matplotlib" else "plots"
    monkeypatch.setattr(doctor, "requirements", lambda: (Requirement(package, needed, extra),))
    monkeypatch.setattr(
        metadata, "version", lambda name: installed if name == package else real(name)
    )
    monkeypatch.setattr(doctor, "_extras", dict)
    values = doctor.diagnose(tmp_path)
    (finding,) = values["findings"]
    for_extra = " for the extra [plots]" if extra else ""
    assert finding.startswith(f"{package} {installed} is installed, {needed} is needed{for_extra};")
    assert finding.endswith(f"-m pip install '{needed}'")
    assert package in page(values)


@pytest.mark.parametrize(
    ("version", "is_older"),
    [
        ("3.9.4", True),
        ("3.10", False),
        ("3.10.0", False),
        ("3.10.0rc1", False),
        ("3.11.2.post1", False),
        ("4", False),
        ("3", True),
    ],
)
def test_versions_are_compared_by_their_numbers(version: str, is_older: bool):
    assert Requirement("p", "p>=3.10", "").is_newer_than(version) == is_older
    assert Requirement("p", "p==3.10.0", "").is_newer_than(version) == is_older
    assert not Requirement("p", "p", "").is_newer_than(version)


def test_an_engine_that_does_not_load_is_a_finding(tmp_path, monkeypatch):
    def refuse(name: str):
        raise ImportError(f"{name}: wrong\nELF class")

    monkeypatch.setattr(doctor, "import_module", refuse)
    values = doctor.diagnose(tmp_path)
    (finding,) = values["findings"]
    assert "wrong ELF class" in finding
    assert "make build" in finding
    assert "! " in page(values)


def test_too_little_space_is_a_finding(tmp_path, monkeypatch):
    usage = shutil.disk_usage(tmp_path)._replace(free=10)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage)
    (finding,) = doctor.diagnose(tmp_path)["findings"]
    assert "less than 1 GB" in finding


def test_a_folder_that_does_not_exist_yet_lies_on_the_disk_of_its_parent(tmp_path):
    disk = doctor.diagnose(tmp_path / "not" / "yet")["disk"]
    assert disk["folder"] == str(tmp_path)
    assert disk["free_bytes"] > 0


def test_threads_are_those_that_this_process_may_use(tmp_path, monkeypatch):
    monkeypatch.setenv("RAYON_NUM_THREADS", "3")
    values = doctor.diagnose(tmp_path)
    assert 1 <= values["threads"]["usable"] <= values["threads"]["processors"]
    assert "RAYON_NUM_THREADS=3" in page(values)


@pytest.mark.parametrize("width", [80, 120])
def test_the_page_fits_the_terminal_and_knows_ascii(tmp_path, width):
    values = doctor.diagnose(tmp_path)
    assert page(values, encoding="ascii", width=width).isascii()
    assert all(len(line) <= width for line in page(values, width=width).splitlines())
