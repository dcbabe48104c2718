"""An evaluation as tables to read."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from overtaking.analysis.evaluation.endpoints import LAW, PRIMARY, SECONDARY
from overtaking.analysis.evaluation.margins import MARGINS
from overtaking.analysis.evaluation.origins import Origin
from overtaking.analysis.evaluation.results import LEAST_EFFECTIVE, TOO_FEW
from overtaking.analysis.stats.table import NO_VALUE, Style, Table
from overtaking.analysis.validation.overtakes import STRATA

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from overtaking.analysis.evaluation.endpoints import Endpoint
    from overtaking.analysis.evaluation.results import Contrast, Evaluation, Rate

_RATES = (
    "Weighted ratios with 95 % intervals: of the bootstrap by scene, or, with fewer than 20 "
    "events, of the gamma method."
)
_CONTRASTS = (
    "Driver minus reference in the same scenes, with the 95 % interval of the paired bootstrap; "
    "pairs are the scenes in which the two differ."
)
_CORRECTED = " Shown are differences whose p-value, corrected by Holm's method, is below 0.05."


def every(found: Evaluation) -> list[Table]:
    """All tables, in the order of the page."""
    groups = [one for name in SECONDARY for one in group(found, name)]
    return [*primary(found), *weather(found), *groups, origins(found), margins(found), worst(found)]


def primary(found: Evaluation) -> list[Table]:
    """The endpoints that were fixed beforehand."""
    return [
        _rates(found, "primary", "Primary endpoints", PRIMARY),
        _contrasts(
            "primary-differences",
            "Differences of the primary endpoints",
            [one for one in found.contrasts if one.is_primary],
            _CONTRASTS,
        ),
    ]


def group(found: Evaluation, name: str) -> list[Table]:
    """The rates of a group of secondary endpoints, and the differences that are shown."""
    file, title = name.replace(" ", "-"), name.capitalize()
    chosen = SECONDARY[name]
    said = [
        one
        for one in found.contrasts
        if one.endpoint in chosen and one.verdict in ("better", "worse", "more", "less")
    ]
    tables = [_rates(found, file, title, [one for one in chosen if _is_met(found, one)])]
    if said:
        tables.append(
            _contrasts(
                f"{file}-differences", f"{title}: differences", said, _CONTRASTS + _CORRECTED
            )
        )
    return tables


def _is_met(found: Evaluation, endpoint: Endpoint) -> bool:
    """Whether any driver has something to divide by."""
    return any(not math.isnan(found.rate(name, endpoint.name).value) for name in found.drivers)


def weather(found: Evaluation) -> list[Table]:
    """The primary endpoints by weather, with how far the weights can be trusted."""
    rows: list[Sequence[object]] = []
    for name in STRATA[1:]:
        there = [one for one in found.rates if one.weather == name]
        for driver in found.drivers:
            own = [one for one in there if one.driver == driver]
            if own:
                weights = f"{own[0].effective:,.0f}", f"{100.0 * own[0].largest:.1f} %"
                rows.append((name, driver, *map(_alone, own), *weights))
    titles = ("weather", "driver", *(one.name.replace("_", "-") for one in PRIMARY))
    columns = dict.fromkeys((*titles, "effective scenes", "largest weight"), Style.TEXT)
    note = (
        "Effective number of scenes in each kind of weather, and the share of the largest weight. "
        "With fewer than ten effective scenes no rate is given. A scene may be of several kinds."
    )
    title = "Primary endpoints by weather"
    return [Table.of(name="weather", title=title, note=note, columns=columns, rows=rows)]


def _alone(rate: Rate) -> str:
    """A rate without its interval, if the weights leave enough scenes."""
    if rate.effective < LEAST_EFFECTIVE:
        return TOO_FEW
    return share(rate).partition(" (")[0]


def origins(found: Evaluation) -> Table:
    """Who began the conflicts, and what a careful and competent driver makes of them."""
    rows: list[Sequence[object]] = []
    for name in found.drivers:
        counts = found.counts[name]
        rows += [(name, one.value, counts[f"origin_{one.name.lower()}"]) for one in Origin]
        rows.append((name, "others' contacts: preventable", counts["preventable"]))
        rows.append((name, "others' contacts: not preventable", counts["unpreventable"]))
        rows.append((name, "not preventable, yet avoided", counts["avoided"]))
    note = (
        "Near-crashes and contacts of the ego, not weighted. Only those that others began in the "
        "ego's lane are called preventable or not, by the careful and competent driver of UN "
        "Regulation 157."
    )
    columns = {"driver": Style.TEXT, "conflict": Style.TEXT, "number": Style.COUNT}
    return Table.of(
        name="origins", title="Who began the conflicts", note=note, columns=columns, rows=rows
    )


def margins(found: Evaluation) -> Table:
    """Quantiles of margins."""
    order = [title for title, _ in MARGINS.values()]
    rows = [
        (one.title, one.driver, one.unit, one.count, one.fifth, one.median, one.last)
        for one in sorted(found.margins, key=lambda one: order.index(one.title))
        if one.count
    ]
    columns = {
        "margin": Style.TEXT,
        "driver": Style.TEXT,
        "unit": Style.TEXT,
        "scenes": Style.COUNT,
        "5 %": Style.NUMBER,
        "median": Style.NUMBER,
        "95 %": Style.NUMBER,
    }
    note = (
        "Weighted quantiles over the attempts; of rules over the scenes in which they apply, "
        "negative in a breach."
    )
    return Table.of(name="margins", title="Margins", note=note, columns=columns, rows=rows)


def worst(found: Evaluation) -> Table:
    """The worst scenes."""
    rows = [(str(one.scene), one.what) for one in found.worst]
    note = (
        "Contacts first, the fastest before the others; then departures, near-crashes and breaches."
    )
    columns = {"scene": Style.TEXT, "what the driver does": Style.TEXT}
    return Table.of(
        name="worst",
        title=f"The worst scenes of {found.policy}",
        note=note,
        columns=columns,
        rows=rows,
    )


def _rates(found: Evaluation, name: str, title: str, chosen: Iterable[Endpoint]) -> Table:
    rows = [
        (_titled(one), *(share(found.rate(driver, one.name)) for driver in found.drivers))
        for one in chosen
    ]
    columns: dict[str, Any] = dict.fromkeys(("endpoint", *found.drivers), Style.TEXT)
    return Table.of(name=name, title=title, note=_RATES, columns=columns, rows=rows)


def _contrasts(name: str, title: str, chosen: Iterable[Contrast], note: str) -> Table:
    rows = [
        (
            _titled(one.endpoint) + ("" if one.weather == STRATA[0] else f", {one.weather}"),
            one.reference,
            _range(one.endpoint, one.difference, one.low, one.high, sign="+"),
            f"{one.pairs:,}",
            one.verdict,
        )
        for one in chosen
    ]
    columns: dict[str, Any] = dict.fromkeys(
        ("endpoint", "minus", "difference", "pairs", "verdict"), Style.TEXT
    )
    return Table.of(name=name, title=title, note=note, columns=columns, rows=rows)


def _titled(endpoint: Endpoint) -> str:
    if endpoint in LAW and "_applies" in endpoint.whole:
        return f"{endpoint.part.partition('_')[0]}, {endpoint.title}"
    return endpoint.title


def share(rate: Rate) -> str:
    """A rate with its interval, in few letters."""
    return _range(rate.endpoint, rate.value, rate.low, rate.high)


def _range(endpoint: Endpoint, value: float, low: float, high: float, sign: str = "") -> str:
    if math.isnan(value):
        return NO_VALUE
    unit = f"\N{NO-BREAK SPACE}{endpoint.unit or '%'}"
    factor = 1.0 if endpoint.unit else 100.0
    middle, below, above = (_short(factor * one, sign) for one in (value, low, high))
    # No line is broken within a number and its unit, nor within an interval.
    return f"{middle}{unit} ({below}\N{NO-BREAK SPACE}to\N{NO-BREAK SPACE}{above})"


def _short(value: float, sign: str) -> str:
    """Two digits after the point for small numbers, fewer for large ones."""
    if math.isnan(value):
        return NO_VALUE
    digits = 0 if abs(value) >= 100.0 else 1 if abs(value) >= 10.0 else 2
    text = f"{value:{sign}.{digits}f}".replace("-", "−")
    return text.lstrip("−+") if not text.strip("−+0.") else text
