"""`overtaking label`: the labels of a data set, made anew."""

import time
from typing import TYPE_CHECKING, Any

from overtaking.cli import options
from overtaking.cli.output import Output

if TYPE_CHECKING:
    from rich.console import RenderableType

    from overtaking.data.load import Dataset


def label(output: Output, data: options.Data) -> None:
    """Label a data set again, with the rules of this version."""
    from overtaking import api

    begin = time.monotonic()
    with output.progress("simulations") as meter:
        labelled = api.relabel(data, progress=meter)
    values = of_labels(labelled, time.monotonic() - begin)
    output.wrote(values, lambda _: render(values))


def of_labels(data: "Dataset", seconds: float) -> dict[str, Any]:
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
        "content_hash": data.content_hash,
        "duration_s": round(seconds, 3),
    }


def render(values: dict[str, Any]) -> "RenderableType":
    """The classes as a table, a column for each policy."""
    from rich.table import Table

    policies = list(values["classes"])
    table = Table(title=f"{values['simulations']:,} simulations by {values['rule_set']}")
    table.add_column("class")
    for policy in policies:
        table.add_column(policy, justify="right")
    names = dict.fromkeys(name for one in values["classes"].values() for name in one)
    for name in names:
        row = [values["classes"][policy].get(name, 0) for policy in policies]
        table.add_row(name, *(f"{count:,}" for count in row))
    return table


COMMANDS: dict[options.Body, str] = {label: "overtaking label data/scene"}
