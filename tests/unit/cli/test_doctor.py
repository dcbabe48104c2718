"""The diagnosis says what is here, and what to do about what is not."""

from __future__ import annotations

import io
import json
import shutil
from importlib import metadata

import pytest
from rich.console import Console

from overtaking.cli import doctor
from overtaking.core.extras import install_command


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
    declared = set(metadata.metadata("overtaking").get_all("Provides-Extra") or []) - {"all"}
    extras = doctor.diagnose(tmp_path)["extras"]
    assert set(extras) == declared
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
    assert values["findings"] == []  # An extra is not needed.


def test_a_library_that_is_missing_is_a_finding(tmp_path, monkeypatch):
    monkeypatch.setattr(doctor, "LIBRARIES", ("numpy", "no-such-library"))
    (finding,) = doctor.diagnose(tmp_path)["findings"]
    assert finding.startswith("no-such-library is missing; install")


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
