"""Checks the installation; the result as values and as a page."""

from __future__ import annotations

import os
import platform
import shutil
from importlib import import_module, metadata
from typing import TYPE_CHECKING, Any

from overtaking.core import process_limits
from overtaking.core.errors import (
    DISTRIBUTION,
    extra_groups,
    install_command,
    pip_command,
    requirements,
)

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console, RenderableType

Values = dict[str, Any]

MIN_FREE_BYTES = 1_000_000_000  # A data set of the paper's size takes a hundredth of that.
_BYTES_PER_GB = 1e9
_AGAIN = "install overtaking again, in a clone by: make build"


def diagnose(folder: Path) -> Values:
    """Collect the facts that a bug report needs.

    Args:
        folder: Where data would be written; its disk is looked at.

    Returns:
        Values of plain Python types; "findings" lists what keeps something from working.
    """
    values: Values = {
        "overtaking": metadata.version(DISTRIBUTION),
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "libraries": _versions(""),
        "engine": _engine(),
        "threads": _threads(),
        "disk": _disk(folder),
        "extras": _extras(),
    }
    values["extra_groups"] = _extra_groups(values["extras"])
    return {**values, "findings": _findings(values)}


def _versions(extra: str) -> dict[str, str | None]:
    """Installed version of each package of an extra, None for a missing package.

    Args:
        extra: Name of the extra; empty for the packages that are always needed.
    """
    return {
        requirement.package: _version(requirement.package)
        for requirement in requirements()
        if requirement.extra == extra
    }


def _version(distribution: str) -> str | None:
    """Version of an installed distribution, None if it is missing."""
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return None


def _engine() -> Values:
    """Whether the compiled engine loads, and how wide it computes."""
    try:
        core = import_module(f"{DISTRIBUTION}._core")
    except ImportError as error:
        return {"loaded": False, "error": " ".join(str(error).split())}
    return {
        "loaded": True,
        "simd": core.default_simd_level(),
        "simd_available": [name for name, is_available in core.simd_levels() if is_available],
        "simd_forced": os.environ.get("OVERTAKING_SIMD"),
    }


def _threads() -> Values:
    """Processors of the machine, of this process, and the limit in the environment."""
    return {
        "processors": os.cpu_count(),
        "usable": process_limits.available_processors(),
        "rayon_num_threads": os.environ.get(process_limits.THREADS_VARIABLE),
    }


def _disk(folder: Path) -> Values:
    """Free space where data would be written."""
    existing = next(one for one in (folder.absolute(), *folder.absolute().parents) if one.is_dir())
    return {
        "folder": str(existing),
        "free_bytes": shutil.disk_usage(existing).free,
        "writable": os.access(existing, os.W_OK),
    }


def _extras() -> dict[str, Values]:
    """Every extra with its packages, and the command that installs the missing ones."""
    extras: dict[str, Values] = {}
    names = dict.fromkeys(requirement.extra for requirement in requirements())
    for extra in filter(None, names):  # Requirements without an extra have an empty name.
        packages = _versions(extra)
        extras[extra] = {
            "packages": packages,
            "installed": all(packages.values()),
            "install": install_command(extra),
        }
    return extras


def _extra_groups(extras: dict[str, Values]) -> dict[str, Values]:
    """Every group of extras, and the command that installs its missing packages."""
    return {
        group: {
            "extras": list(names),
            "missing": [name for name in names if name in extras and not extras[name]["installed"]],
            "install": install_command(group),
        }
        for group, names in extra_groups().items()
    }


def _outdated() -> list[str]:
    """A line for each installed package that is older than this one needs."""
    lines: list[str] = []
    for requirement in requirements():
        version = _version(requirement.package)
        if version is not None and requirement.is_newer_than(version):
            needed = f"{requirement.specifier} is needed"
            needed += f" for the extra [{requirement.extra}]" if requirement.extra else ""
            command = pip_command(requirement.specifier)
            lines.append(f"{requirement.package} {version} is installed, {needed}; run: {command}")
    return lines


def _findings(values: Values) -> list[str]:
    """Problems, each with the next step."""
    engine, disk = values["engine"], values["disk"]
    findings = [
        f"{name} is missing; {_AGAIN}"
        for name, version in values["libraries"].items()
        if version is None
    ]
    findings += _outdated()
    if not engine["loaded"]:
        findings.append(f"the engine does not load ({engine['error']}); {_AGAIN}")
    if not disk["writable"]:
        findings.append(f"{disk['folder']} is not writable; choose another --out")
    if disk["free_bytes"] < MIN_FREE_BYTES:
        findings.append(f"{disk['folder']} has less than 1 GB left; choose another --out")
    return findings


def render(values: Values, console: Console) -> RenderableType:
    """The diagnosis as a page."""
    from rich.text import Text

    from overtaking.cli.tables import open_table

    works, lacks = ("ok", "--") if console.options.ascii_only else ("✓", "–")
    table = open_table("", "", "", num_labels=2)
    engine, threads, disk = values["engine"], values["threads"], values["disk"]
    rows = [
        (works, "overtaking", values["overtaking"]),
        (works, "Python", f"{values['python']} on {values['system']}"),
        (works, "libraries", ", ".join(f"{k} {v}" for k, v in values["libraries"].items())),
        (works if engine["loaded"] else "!", "engine", _engine_line(engine)),
        (works, "threads", _threads_line(threads)),
        (works if disk["writable"] else "!", "disk", _disk_line(disk)),
    ]
    for name, extra in values["extras"].items():
        packages = ", ".join(f"{k} {v or 'missing'}" for k, v in extra["packages"].items())
        line = packages if extra["installed"] else f"{packages}: {extra['install']}"
        rows.append((works if extra["installed"] else lacks, f"extra [{name}]", line))
    for name, group in values["extra_groups"].items():
        missing = group["missing"]
        line = f"extras {', '.join(group['extras'])}"
        line += f"; missing {', '.join(missing)}: {group['install']}" if missing else ""
        rows.append((lacks if missing else works, f"extras [{name}]", line))
    rows += [("!", "finding", finding) for finding in values["findings"]]
    for mark, name, text in rows:
        table.add_row(mark, Text(name, style="bold"), Text(text))
    return table


def _engine_line(engine: Values) -> str:
    """The engine in words."""
    if not engine["loaded"]:
        return engine["error"]
    forced = f", forced by OVERTAKING_SIMD={engine['simd_forced']}" if engine["simd_forced"] else ""
    available = ", ".join(engine["simd_available"])
    return f"Rust, SIMD level {engine['simd']}{forced} (available: {available})"


def _threads_line(threads: Values) -> str:
    """The threads in words."""
    asked = threads["rayon_num_threads"]
    limit = f", RAYON_NUM_THREADS={asked}" if asked else ""
    return f"{threads['usable']} of {threads['processors']} processors usable{limit}"


def _disk_line(disk: Values) -> str:
    """The disk in words."""
    return f"{disk['free_bytes'] / _BYTES_PER_GB:.1f} GB free at {disk['folder']}"
