"""The page of `overtaking validate`: figures and targets, classes by weather, rates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rich.console import Group
from rich.text import Text

from overtaking.analysis.validation.targets import TargetRole
from overtaking.cli.tables import open_table
from overtaking.knowledge.quantities import ENGINEERING_CHOICE
from overtaking.model.import_report import ImportFinding, summarize_findings

if TYPE_CHECKING:
    from collections.abc import Mapping

    from overtaking.cli.tables import FittingTable

Values = dict[str, Any]


def render(values: Values) -> Group:
    """A validation as a page."""
    outside = sum(figure["met"] is False for figure in values["figures"])
    verdict = f"{outside or 'no'} figure{'' if outside == 1 else 's'} outside the limits"
    head = f"{values['profile']}: {values['simulations']:,} simulations, {verdict}"
    if not values["met"]:
        head += " (exit status 1)"
    meanings = "\n".join(f"{one}: {one.meaning}" for one in TargetRole)
    parts = [Text(head), Text(), _figures(values["figures"]), Text(), Text(meanings, "dim")]
    parts += [Text(), _strata(values["strata"])]
    if values["comparison"]:
        parts += [_missing(values["missing"]), Text(), *_comparison(values["comparison"])]
    if values["recordings"]:
        parts += [Text(), *_recordings(values["recordings"])]
    return Group(*parts)


def _recordings(found: Values) -> tuple[Text, FittingTable]:
    dense = ", ".join(f"{one:.0f}" for one in found["densities"])
    head = f"{len(found['files'])} recordings beside rings of {dense} vehicles/km/lane"
    head += "".join(f"\nnot used: {one}" for one in found["unused"])
    findings = (ImportFinding(**row) for row in found["import_report"])
    head += "".join(f"\nimport report: {line}" for line in summarize_findings(findings))
    table = open_table("quantity", "recorded>", "simulated>", "values>", "distance>")
    for one in found["likenesses"]:
        table.add_row(
            one["title"],
            f"{number(one['recorded_median'])} {one['unit']}",
            f"{number(one['simulated_median'])} {one['unit']}",
            f"{one['recorded']:,} and {one['simulated']:,}",
            number(one["distance"]),
        )
    return Text(head), table


def _figures(figures: list[Values]) -> FittingTable:
    table = open_table("figure", "value>", "95 % interval>", "target>", "standing>", "verdict>")
    for figure in figures:
        low, high = (number(figure[name]) for name in ("low", "high"))
        unit = f" {figure['unit']}" if figure["unit"] else ""
        table.add_row(
            figure["title"],
            f"{number(figure['value'])}{unit}",
            f"{low} .. {high}",
            _target(figure),
            figure["standing"],
            _verdict(figure),
        )
    return table


def _target(figure: Values) -> str:
    low, high = figure["target_low"], figure["target_high"]
    if low is None and high is None:
        return ""
    if low is None:
        return f"<= {number(high)}"
    return f">= {number(low)}" if high is None else f"{number(low)} .. {number(high)}"


def _verdict(figure: Values) -> Text:
    if figure["needs_km"]:
        return Text(f"needs {figure['needs_km']:,.0f} km", "dim")
    if figure["met"] is None:
        return Text("not measured" if _target(figure) else "", "dim")
    is_ours = ENGINEERING_CHOICE in (figure["standing"], figure["source"])
    if is_ours:
        said = "within our limits" if figure["met"] else "outside our limits"
    else:
        said = "met" if figure["met"] else "missed"
    return Text(said if figure["sure"] else f"{said}, unsure", "" if figure["met"] else "bold red")


def _strata(strata: Mapping[str, Values]) -> FittingTable:
    names = list(next(iter(strata.values()))["counts"])
    table = open_table("weather", *(f"{name}>" for name in names))
    for stratum, found in strata.items():
        cells = [
            f"{found['counts'][name]:,}"
            + (f" ({found['shares'][name]:.2%})" if found["shares"][name] is not None else "")
            for name in names
        ]
        table.add_row(stratum, *cells)
    return table


def _missing(pairs: list[list[str]]) -> Text:
    if not pairs:
        return Text("every class of the study occurs in every kind of weather")
    said = ", ".join(f"{kind} ({weather})" for weather, kind in pairs)
    return Text(f"no simulation: {said}", "bold red")


def _comparison(rates: list[Values]) -> tuple[Text, FittingTable]:
    apart = sum(not rate["agrees"] for rate in rates)
    verdict = "all agree" if not apart else f"{apart} disagree"
    table = open_table("rate", "weighted>", "natural>", "difference, interval>", "verdict>")
    for rate in rates:
        unit = f" {rate['unit']}" if rate["unit"] else ""
        table.add_row(
            rate["title"],
            f"{number(rate['weighted'])}{unit}",
            f"{number(rate['natural'])}{unit}",
            f"{number(rate['low'])} .. {number(rate['high'])}",
            Text("agrees") if rate["agrees"] else Text("disagrees", "bold red"),
        )
    head = (
        f"{len(rates)} rates that are common enough to compare, {verdict} (95 % for all together)"
    )
    return Text(head), table


def number(value: float | None) -> str:
    """A number with three digits that matter."""
    return "-" if value is None else f"{value:.3g}"
