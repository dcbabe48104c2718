"""Summaries of data sets and exported tables, as values and as text."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Any

from rich.console import Group
from rich.text import Text

from overtaking.cli.tables import CommandLine, facts

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.cli.tables import FittingTable
    from overtaking.data.load import Dataset

Values = dict[str, Any]

_BYTES_PER_MB = 1e6


def of_dataset(data: Dataset) -> Values:
    """Summary of a data set, from its manifest."""
    manifest = data.manifest
    identity, provenance = manifest.identity, manifest.provenance
    tables = {name: {"rows": 0, "size_bytes": 0} for name in identity.tables}
    for shard in manifest.shards:
        for name, file in shard.tables.items():
            tables[name]["rows"] += file.rows
            tables[name]["size_bytes"] += file.size_bytes
    return {
        "data": data.where,
        "profile": data.profile,
        "simulations": len(data),
        "seed": identity.seed,
        "road": data.road.name,
        "keep": str(identity.keep),
        "simulator": f"{identity.simulator} {identity.simulator_version}",
        "content_hash": data.content_hash,
        "shards": len(manifest.shards),
        "tables": tables,
        **({"clipped": manifest.clipped} if identity.policy else {}),
        **_balance(data),
        "finished": provenance.finished,
        "package": provenance.package,
        "machine": provenance.machine,
    }


def _balance(data: Dataset) -> Values:
    """Settings and result of balancing; empty for other data sets."""
    manifest = data.manifest
    settings, found = manifest.identity.balance, manifest.balance
    if settings is None or found is None:
        return {}
    return {
        "balance": {
            "by": list(settings.by),
            "policy": settings.policy,
            "wanted": manifest.identity.simulations,
            **found.model_dump(),
        }
    }


def render_generated(values: Values) -> Group:
    """Summary of a new data set in a few lines, with the next command."""
    seconds = values["duration_s"]
    rate = values["simulations"] / max(seconds, 1e-3)
    lines = [
        f"{values['simulations']:,} simulations of {values['profile']} in {values['data']}: "
        f"{_megabytes(values):.1f} MB, {seconds:.1f} s, {rate:,.0f}/s",
        f"content {values['content_hash']}",
    ]
    if "balance" in values:
        lines.append(f"balanced: {_shares(values)}")
    if count := values.get("clipped", 0):
        lines.append(f"{count:,} answers of the policy were outside the limits and were clipped")
    return Group(*map(Text, lines), show_command(values["data"], "next: "))


def show_command(data: str, label: str = "") -> CommandLine:
    """The command that shows the first simulation of a data set.

    Args:
        data: The data set.
        label: Text before the command.
    """
    return CommandLine(("overtaking", "show", shlex.quote(data), "0"), label)


def _shares(values: Values) -> str:
    """The cells of a balanced data set in words."""
    found = values["balance"]
    cells = ", ".join(f"{one['kept']:,} {name}" for name, one in found["cells"].items())
    missing = f"; {found['missing']:,} are missing" if found["missing"] else ""
    return f"{cells} of {found['candidates']:,} candidates{missing}"


def render(values: Values) -> FittingTable:
    """A data set as a page."""
    names = ("data", "profile", "simulations", "seed", "road", "keep", "simulator")
    rows = [(name, values[name]) for name in names]
    rows.append(("content", values["content_hash"]))
    if "balance" in values:
        rows.append(("balance", _shares(values)))
    if "clipped" in values:
        rows.append(("clipped answers", f"{values['clipped']:,}"))
    rows.append(("made", f"{values['finished']} by overtaking {values['package']}"))
    rows.append(("on", values["machine"]))
    for name, table in values["tables"].items():
        size = table["size_bytes"] / _BYTES_PER_MB
        rows.append((f"table {name}", f"{table['rows']:,} rows, {size:.2f} MB"))
    return facts(rows)


def _megabytes(values: Values) -> float:
    """Size of all tables."""
    return sum(table["size_bytes"] for table in values["tables"].values()) / _BYTES_PER_MB


def of_table(path: Path, rows: int) -> Values:
    """Summary of an export."""
    files = list(path.iterdir()) if path.is_dir() else [path]
    size = sum(file.stat().st_size for file in files)
    return {"file": str(path), "rows": rows, "files": len(files), "size_bytes": size}


def render_table(values: Values) -> Text:
    """One line about the export."""
    size = values["size_bytes"] / _BYTES_PER_MB
    return Text(f"{values['rows']:,} rows in {values['file']}: {size:.1f} MB")
