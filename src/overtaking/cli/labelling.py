"""`overtaking label`: the labels of a data set, made anew."""

from typing import TYPE_CHECKING, Any

from overtaking.cli import options
from overtaking.cli.output import Output
from overtaking.cli.tables import drawn_rows

if TYPE_CHECKING:
    from rich.console import RenderableType

    from overtaking.data.load import Dataset


def label(output: Output, data: options.Data) -> None:
    """Label a data set again, with the rules of this version."""
    from overtaking import api

    with output.progress("simulations") as meter:
        labelled = api.relabel(data, progress=meter)
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
        "content_hash": data.content_hash,
    }


def render(values: dict[str, Any]) -> "RenderableType":
    """The classes as a table, a column for each policy."""
    classes = values["classes"]
    names = dict.fromkeys(name for one in classes.values() for name in one)
    rows = [(name, *(f"{one.get(name, 0):,}" for one in classes.values())) for name in names]
    title = f"{values['simulations']:,} simulations by {values['rule_set']}"
    return drawn_rows(("class", *(f"{policy}>" for policy in classes)), rows, title=title)
