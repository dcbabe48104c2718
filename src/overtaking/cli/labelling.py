"""`overtaking label`: the labels of a data set, made anew."""

from typing import TYPE_CHECKING, Annotated, Any

from overtaking.cli import options
from overtaking.cli.output import Output
from overtaking.cli.tables import drawn_rows

if TYPE_CHECKING:
    from rich.console import RenderableType

    from overtaking.data.load import Dataset


PositionError = Annotated[
    float | None,
    options.option(
        "--position-error M",
        "Standard deviation of recorded positions [m]. A margin of less than two standard errors "
        "is undecidable.  [default: 0]",
    ),
]
SpeedError = Annotated[
    float | None,
    options.option(
        "--speed-error MPS", "Standard deviation of recorded speeds [m/s].  [default: 0]"
    ),
]


def label(
    output: Output,
    data: options.Data,
    position_error: PositionError = None,
    speed_error: SpeedError = None,
) -> None:
    """Label a data set again, with the rules of this version."""
    from overtaking import api
    from overtaking.cli import arguments

    given = arguments.given(position_error=position_error, speed_error=speed_error)
    with output.progress("simulations") as meter:
        labelled = api.relabel(data, progress=meter, **given)
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


def of_rules(data: "Dataset") -> dict[str, dict[str, int]]:
    """Number of simulations that each rule finds legal, illegal and undecidable."""
    verdicts = data.findings().groupby("rule", observed=True, sort=False)["verdict"]
    counts = {str(rule): rows.value_counts() for rule, rows in verdicts}
    return {
        rule: {name: int(count.get(name, 0)) for name in ("legal", "illegal", "undecidable")}
        for rule, count in counts.items()
    }


def render(values: dict[str, Any]) -> "RenderableType":
    """The classes, a column for each policy, and what each rule finds."""
    from rich.console import Group

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
