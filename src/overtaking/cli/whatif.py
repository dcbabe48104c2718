"""What if: twins, fans, and changes that would have been enough."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from overtaking.cli import arguments, options
from overtaking.cli.output import Output

if TYPE_CHECKING:
    from rich.console import RenderableType

    from overtaking.analysis.whatif.enough import Enough
    from overtaking.analysis.whatif.twin import Twin

Without = Annotated[
    str | None,
    options.option(
        "--without NAMES",
        "Take away from the weather: rain (with film, spray, puddles and clouds), wind, fog, "
        "night, glare; several with commas.",
    ),
]
DrivingStyle = Annotated[
    str | None,
    options.option(
        "--style STYLE", "Another driving style of the ego: careful, average or reckless."
    ),
]
Stay = Annotated[bool, options.option("--stay", "The ego never begins an overtake.")]
Delay = Annotated[
    float | None,
    options.option("--delay S", "Delay of the attempt, without regard to the gaps [s]."),
]
StartTime = Annotated[
    float,
    options.option(
        "--start-time S", "Time from which weather, driving style or --stay are different [s]."
    ),
]
EffectName = Annotated[
    str,
    options.option(
        "--effect direct|total",
        "direct: continue from the state at the start time; total: draw speeds and distances at "
        "the start again for the changed weather or driver, from the same random numbers.",
    ),
]
Film = Annotated[
    Path | None, options.option("--film FILE", "Film both, one above the other, as .mp4.")
]
Save = Annotated[
    Path | None,
    options.option("--out FOLDER", f"{options.OUT} A new folder, for both as a data set."),
]
ConditionOn = Annotated[
    str,
    options.option(
        "--condition-on truth|belief",
        "truth: the others as they are, which is hindsight; belief: people and unnoticed vehicles "
        "drawn anew, in agreement with what the ego notices.",
    ),
]
Futures = Annotated[int, options.option("--futures N", "Futures at each instant.")]
Interval = Annotated[
    float, options.option("--interval S", "Time from one instant to the next [s].")
]
Goal = Annotated[
    str,
    options.option(
        "--goal NAME",
        "lawful: completed without a breach that the policy counts; safe: without collision, on "
        "the road.",
    ),
]


def twin(
    output: Output,
    data: options.Data,
    simulation: options.Number,
    without: Without = None,
    driving_style: DrivingStyle = None,
    stay: Stay = False,
    delay: Delay = None,
    start_time: StartTime = 0.0,
    effect: EffectName = "direct",
    policy: options.Policy = None,
    film: Film = None,
    plot: options.Plot = None,
    out: Save = None,
) -> None:
    """Compare a simulation with a branch that differs in one thing.

    Prints both classes and the first frame in which the two differ.
    """
    from overtaking.api import reports, whatif

    figure = arguments.figure_file(plot)
    found = whatif.counterfactual(
        data,
        simulation,
        without=[one.strip() for one in without.split(",")] if without else (),
        driving_style=driving_style,
        stay=stay,
        delay=delay,
        start_time=start_time,
        effect=effect,
    )
    values = values_of_twin(found, policy)
    files = []
    if figure is not None:
        reports.plot(found, out=figure, policy=policy)
        files.append(figure)
    if film is not None:
        files.append(reports.film(found, film, policy=policy))
    if out is not None:
        files.append(whatif.save_branches(data, found, out).path)
    values["files"] = [str(one) for one in files]
    output.result(values, lambda _: render_twin(values))


def fan(
    output: Output,
    data: options.Data,
    simulation: options.Number,
    condition_on: ConditionOn = "truth",
    futures: Futures = 25,
    interval: Interval = 0.5,
    policy: options.Policy = None,
    plot: options.Plot = None,
) -> None:
    """Show the outcomes of an overtake begun at each instant.

    Prints the share of each class among many futures, with 95 % intervals.
    """
    from overtaking.api import reports, whatif
    from overtaking.show.futures import values_of_fan

    figure = arguments.figure_file(plot)
    with output.progress("instants") as meter:
        found = whatif.outcome_fan(
            data,
            simulation,
            condition_on=condition_on,
            futures=futures,
            interval=interval,
            policy=policy,
            progress=meter,
        )
    values = values_of_fan(found)
    if figure is not None:
        reports.plot(found, out=figure)
        values["files"] = [str(figure)]
    output.result(values, lambda _: render_fan(values))


def enough(
    output: Output,
    data: options.Data,
    simulation: options.Number,
    goal: Goal = "lawful",
    policy: options.Policy = None,
) -> None:
    """Find single changes that make a simulation lawful or safe.

    A stated list of quantities is tried, each alone; every answer is simulated. Many may be enough,
    and none of them is the cause.
    """
    from overtaking.api import whatif

    with output.progress("quantities") as meter:
        found = whatif.sufficient_changes(
            data, simulation, goal=goal, policy=policy, progress=meter
        )
    values = values_of_enough(found)
    output.result(values, lambda _: render_enough(values))


def values_of_twin(one: "Twin", policy: str | None) -> dict[str, Any]:
    """Twins as plain values; without a policy, under the default of their profile."""
    from overtaking.analysis.whatif.scenes import class_of
    from overtaking.labels.law.judging import choose_policy

    policy = choose_policy(policy, one.profile)
    parting = one.parting
    return {
        "simulation": one.number,
        "different": one.title,
        "effect": str(one.effect),
        "since_s": one.since,
        "policy": policy,
        "class_before": class_of(one.labelled[0], policy),
        "class_after": class_of(one.labelled[1], policy),
        "trace_hash_before": one.told[0].run.trace_hash[0].tobytes().hex(),
        "trace_hash_after": one.told[1].run.trace_hash[0].tobytes().hex(),
        "interventions": list(one.told[1].record.interventions),
        "redrawn": one.told[1].record.redrawn,
        "pulls_out_before_s": one.begins[0],
        "pulls_out_after_s": one.begins[1],
        "lamps_differ_s": None if one.lamps is None else round(one.lamps, 3),
        "parting": parting
        and {
            "frame": parting.frame,
            "time_s": round(parting.time, 3),
            "vehicle": parting.vehicle,
            "quantity": parting.quantity,
            "by": round(parting.by, 4),
            "ego_time_s": None if parting.ego_time is None else round(parting.ego_time, 3),
        },
    }


def render_twin(values: dict[str, Any]) -> "RenderableType":
    """Twins as a table."""
    from overtaking.cli.tables import facts

    start = values["effect"] == "total"
    since = "drawn again from the start" if start else f"from {values['since_s']:.2f} s on"
    rows: list[tuple[str, object]] = [
        ("simulation", str(values["simulation"])),
        ("different", f"{values['different']}; {values['effect']} effect, {since}"),
        ("class as it was", values["class_before"]),
        ("class then", f"{values['class_after']} (policy {values['policy']})"),
        (
            "it pulls out",
            f"{_at(values['pulls_out_before_s'])}; then {_at(values['pulls_out_after_s'])}",
        ),
        ("they part", _parting(values["parting"])),
    ]
    if values["lamps_differ_s"] is not None:
        rows.append(("lamps differ", f"at {values['lamps_differ_s']:.2f} s"))
    rows += [("written", one) for one in values["files"]]
    return facts(rows)


def _at(time: float | None) -> str:
    return "never" if time is None else f"at {time:.2f} s"


def _parting(found: dict[str, Any] | None) -> str:
    if found is None:
        return "never: all move alike, to the last bit"
    who = "the ego" if found["vehicle"] == 0 else f"vehicle {found['vehicle']}"
    text = f"at {found['time_s']:.2f} s (frame {found['frame']}): {found['quantity']} of {who}"
    if found["vehicle"] == 0:
        return text
    own = found["ego_time_s"]
    return f"{text}; the ego {'never' if own is None else f'at {own:.2f} s'}"


def render_fan(values: dict[str, Any]) -> "RenderableType":
    """A fan as a table: a row for each instant."""
    from rich.console import Group
    from rich.text import Text

    from overtaking.cli.tables import drawn_rows
    from overtaking.show.futures import CONDITION_TEXTS

    names = list(values["instants"][0]["shares"]) if values["instants"] else []
    header = ["told [s]>", "pulls out [s]>", "futures>", *(f"{name} [%]>" for name in names)]
    rows = []
    for one in values["instants"]:
        begun = "-" if one["pulls_out_s"] is None else f"{one['pulls_out_s']:.2f}"
        cells = [_share(one["shares"][name]) for name in names]
        rows.append([f"{one['told_s']:.2f}", begun, str(one["futures"]), *cells])
    about = CONDITION_TEXTS[values["condition_on"]]
    head = f"P(class | start at t) of simulation {values['simulation']}, {about}"
    return Group(Text(head), drawn_rows(header, rows))


def _share(found: dict[str, Any]) -> str:
    if found["share"] is None:
        return "too few"
    return f"{100 * found['share']:.0f} ({100 * found['low']:.0f}-{100 * found['high']:.0f})"


def _number(value: float) -> float | None:
    return None if value != value else round(float(value), 4)


def values_of_enough(one: "Enough") -> dict[str, Any]:
    """What would have been enough, as plain values."""
    return {
        "simulation": one.number,
        "goal": one.goal,
        "policy": one.policy,
        "class": one.was,
        "simulated": one.simulated,
        "quantities": [
            {
                "quantity": found.name,
                "unit": found.unit,
                "least": found.least,
                "class": found.becomes,
                "tried": found.tried and list(found.tried),
                "larger": _number(found.larger),
            }
            for found in one.found
        ],
    }


def render_enough(values: dict[str, Any]) -> "RenderableType":
    """What would have been enough, as a table."""
    from rich.console import Group
    from rich.text import Text

    from overtaking.cli.tables import drawn_rows

    rows = []
    for one in values["quantities"]:
        span = one["tried"] and "{:+g} to {:+g}".format(*one["tried"])
        is_found = one["least"] is not None
        least = f"{one['least']:+g} {one['unit']}" if is_found else "none is enough"
        larger = "" if one["larger"] is None else f"{100 * one['larger']:.0f} %"
        becomes = one["class"] if is_found else ""
        rows.append([one["quantity"], least, becomes, span or "cannot be changed", larger])
    head = (
        f"Simulation {values['simulation']} is {values['class']} (policy {values['policy']}). Each "
        f"of these alone would have made it {values['goal']}; {values['simulated']} were "
        "simulated, and none is the cause."
    )
    header = ["quantity", "smallest change", "class then", "tried", "larger ones, too>"]
    return Group(Text(head), drawn_rows(header, rows))
