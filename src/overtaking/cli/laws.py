"""Laws, policies and tolerances on a data set."""

from typing import TYPE_CHECKING, Annotated, Any

from overtaking.cli import options
from overtaking.cli.output import Output

if TYPE_CHECKING:
    from rich.console import RenderableType

Rules = Annotated[
    str | None,
    options.option("--rules CODE,CODE", "Rules to explain, separated by commas.  [default: all]"),
]


def curve(
    output: Output,
    data: options.Data,
    error_options: options.MeasurementErrorOptions,
    law: options.Law = "pt",
    policy: options.Policy = None,
    plot: options.Plot = None,
) -> None:
    """Count legal overtakes as tolerances are relaxed.

    Also which rule alone decides, and in how many overtakes. Nothing is written.
    """
    from overtaking.api import law as api_law
    from overtaking.api import reports
    from overtaking.cli import arguments

    figure = arguments.figure_file(plot)
    errors = arguments.measurement_errors(error_options)
    with output.progress("simulations") as meter:
        curve = api_law.tolerance_curve(data, law=law, policy=policy, progress=meter, errors=errors)
    if figure is not None:
        reports.plot(curve, out=figure)
    values = curve.to_dict()
    output.result(values, lambda _: render_curve(values))


def compare(
    output: Output,
    data: options.Data,
    error_options: options.MeasurementErrorOptions,
    law: options.Law = "pt,de",
    policies: options.Policies = "paper,default,strict,serious,enforced",
) -> None:
    """Judge a data set by several laws and show where they differ.

    Nothing is written.
    """
    from overtaking.api import law as api_law
    from overtaking.cli import arguments

    errors = arguments.measurement_errors(error_options)
    laws, chosen = ([one.strip() for one in text.split(",")] for text in (law, policies))
    with output.progress("simulations") as meter:
        values = api_law.compare(data, laws, policies=chosen, progress=meter, errors=errors)
    output.result(values, lambda _: render_comparison(values))


def explain(
    output: Output,
    data: options.Data,
    simulation: options.Number,
    error_options: options.MeasurementErrorOptions,
    law: options.Law = "pt",
    rules: Rules = None,
) -> None:
    """Explain each verdict on a simulation in a paragraph.

    Broken rules come first. A paragraph has the article, the facts, the margin, and what would have
    been lawful.
    """
    from overtaking.api import law as api_law
    from overtaking.cli import arguments

    errors = arguments.measurement_errors(error_options)
    codes = None if rules is None else [one.strip() for one in rules.split(",")]
    told = api_law.explain(data, simulation, law=law, rules=codes, errors=errors)
    output.result({"verdicts": told}, lambda _: render_paragraphs(told))


def render_paragraphs(told: list[dict[str, Any]]) -> "RenderableType":
    """The paragraphs, one below the other; rules that do not apply in one line."""
    from rich.console import Group
    from rich.text import Text

    lines = [
        Text.assemble((f"{one['rule']} ", "bold"), one["paragraph"], "\n")
        for one in told
        if one["verdict"] != "not_applicable" or len(told) == 1
    ]
    silent = [one["rule"] for one in told if one["verdict"] == "not_applicable"]
    if silent and len(told) > 1:
        lines.append(Text(f"Do not apply: {', '.join(silent)}", style="dim"))
    return Group(*lines)


def render_curve(values: dict[str, Any]) -> "RenderableType":
    """Shares by tolerance, and the rules."""
    from rich.console import Group

    from overtaking.cli.tables import drawn_rows

    title = (
        f"{values['overtakes']:,} overtakes by {values['rule_set']}, policy {values['policy']}: "
        f"{values['legal']:,} legal ({values['legal_share']:.1%})"
    )
    rows = [
        (
            tolerance["tolerance"],
            ", ".join(
                f"{value:g} {tolerance['unit']}: {share:.1%}"
                for value, share in zip(tolerance["values"], tolerance["legal_share"], strict=True)
            ),
        )
        for tolerance in values["legal_by_tolerance"]
    ]
    rules = [
        (rule["rule"], rule["title"], f"{rule['broken']:,}", f"{rule['broken_alone']:,}")
        for rule in values["rules"]
        if rule["broken"]
    ]
    return Group(
        drawn_rows(("tolerance", "share of legal overtakes"), rows, title=title),
        "",
        drawn_rows(("rule", "title", "broken>", "broken alone>"), rules),
    )


def render_comparison(values: dict[str, Any]) -> "RenderableType":
    """Legal overtakes by law and policy, and overtakes on which laws differ."""
    from rich.console import Group

    from overtaking.cli.tables import drawn_rows

    names = dict.fromkeys(name for law in values["laws"] for name in law["classes"])
    rows = [
        (
            law["law"],
            law["policy"],
            *(f"{law['classes'].get(name, 0):,}" for name in names),
            *(f"{count:,}" for count in law["conduct"].values()),
        )
        for law in values["laws"]
    ]
    versions = ", ".join(values["rule_sets"].values())
    title = f"{values['simulations']:,} simulations by {versions}"
    disagreements = [
        (
            f"{difference['legal_under']}, not {difference['illegal_under']}",
            difference["policy"],
            f"{difference['overtakes']:,}",
            ", ".join(f"{rule} {count:,}" for rule, count in difference["rules"].items()),
            ", ".join(str(example["simulation"]) for example in difference["examples"]),
        )
        for difference in values["disagreements"]
        if difference["overtakes"]
    ]
    columns = (*names, "rules kept", "broken", "undecidable")
    heads = ("legal under", "policy", "overtakes>", "broken under the other", "examples")
    return Group(
        drawn_rows(("law", "policy", *(f"{name}>" for name in columns)), rows, title=title),
        "",
        drawn_rows(heads, disagreements),
    )
