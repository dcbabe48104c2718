"""`overtaking label`: the labels of a data set, made anew."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from overtaking.cli import options
from overtaking.cli.output import Output

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.console import RenderableType

    from overtaking.data.load import Dataset
    from overtaking.labels.labelling import LabelledTrajectories


_DECIDED = ("legal", "illegal", "undecidable")
Out = Annotated[
    Path | None,
    options.option(
        "--out FILE",
        f"{options.OUT} A Parquet file of the verdicts, one row per simulation and policy.",
    ),
]


def label(
    output: Output,
    data: options.Data,
    error_options: options.MeasurementErrorOptions,
    law: options.OpenLaw = None,
    policies: options.OpenPolicies = None,
    out: Out = None,
) -> None:
    """Label a data set again, with the rules of this version.

    With --law, --policies or --out the data set stays as it is.
    """
    from overtaking.api import datasets
    from overtaking.api import law as api_law
    from overtaking.cli import arguments

    errors = arguments.measurement_errors(error_options)
    if law is not None or policies is not None or out is not None:
        named = None if policies is None else [one.strip() for one in policies.split(",")]
        chosen = arguments.given(policies=named, out=out, errors=errors)
        with output.progress("simulations") as meter:
            batches = api_law.judge(data, law or "pt", progress=meter, **chosen)
            judged = of_batches(data, batches) | output.duration
        return output.result(judged, lambda _: render(judged))
    with output.progress("simulations") as meter:
        labelled = datasets.relabel_dataset(data, errors=errors, progress=meter)
    values = of_labels(labelled) | output.duration
    output.wrote(values, lambda _: render(values))


def of_labels(data: "Dataset") -> dict[str, Any]:
    """Number of simulations of each class under each policy."""
    labels = data.labels()
    classes = {
        str(policy): {name: int(count) for name, count in rows.value_counts().items() if count}
        for policy, rows in labels.groupby("policy", observed=True)["class"]
    }
    return {
        "data": str(data.path),
        "simulations": len(data),
        "rule_set": str(labels["rule_set"].iloc[0]),
        "classes": classes,
        "rules": of_rules(data),
        "content_hash": data.content_hash,
    }


def of_batches(data: str, batches: "Iterable[tuple[Any, LabelledTrajectories]]") -> dict[str, Any]:
    """The same, from labels that are not written."""
    from overtaking.model.verdicts import OvertakeClass, Verdict

    classes: dict[str, Counter[str]] = {}
    rules: dict[str, Counter[str]] = {}
    total, version = 0, ""
    for numbers, said in batches:
        total, version = total + len(numbers), said.findings.version
        for index, policy in enumerate(said.labels.policies):
            names = (OvertakeClass(one).title for one in said.labels.classes[:, index])
            classes.setdefault(policy, Counter()).update(names)
        for index, rule in enumerate(said.findings.rule_codes):
            verdicts = (Verdict(one).name.lower() for one in said.findings.verdict[:, index])
            rules.setdefault(rule, Counter()).update(verdicts)
    return {
        "data": data,
        "simulations": total,
        "rule_set": version,
        "classes": {policy: dict(sorted(count.items())) for policy, count in classes.items()},
        "rules": {rule: {one: count[one] for one in _DECIDED} for rule, count in rules.items()},
    }


def of_rules(data: "Dataset") -> dict[str, dict[str, int]]:
    """Number of simulations that each rule finds legal, illegal and undecidable."""
    verdicts = data.findings().groupby("rule", observed=True, sort=False)["verdict"]
    counts = {str(rule): rows.value_counts() for rule, rows in verdicts}
    return {
        rule: {name: int(count.get(name, 0)) for name in _DECIDED} for rule, count in counts.items()
    }


def render(values: dict[str, Any]) -> "RenderableType":
    """The classes, a column for each policy, and what each rule finds."""
    from rich.console import Group

    from overtaking.cli.tables import drawn_rows

    classes = values["classes"]
    names = dict.fromkeys(name for one in classes.values() for name in one)
    rows = [(name, *(f"{one.get(name, 0):,}" for one in classes.values())) for name in names]
    title = f"{values['simulations']:,} simulations by {values['rule_set']}"
    found = drawn_rows(("class", *(f"{policy}>" for policy in classes)), rows, title=title)
    rules = [
        (rule, *(f"{one:,}" for one in count.values()))
        for rule, count in values["rules"].items()
        if any(count.values())
    ]
    verdicts = ("rule", "legal>", "illegal>", "undecidable>")
    return Group(found, "", drawn_rows(verdicts, rules))
