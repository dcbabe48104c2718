"""One simulation on a terminal: who was there, what the ego did and believed, how it ended."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from overtaking.cli.description import lane_name, present
from overtaking.cli.drawing import (
    Glyphs,
    Strip,
    bar_lengths,
    centred,
    nice_reach,
    sparkline,
    symbol,
)
from overtaking.core.units import kmh_from_mps
from overtaking.model.trajectory import METRES_PER_SECOND_PER_STEP, METRES_PER_STEP, Stage
from overtaking.model.vehicles import Role

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.console import Console, RenderableType

    from overtaking.cli.description import Values
    from overtaking.model.trajectory import Trajectories

MAX_WIDTH = 110
MAX_VEHICLES = 9
MAX_INSTANTS = 20
# Okabe and Ito's colours, which people with any kind of colour vision can tell apart.
STAGE_STYLES = {
    "FOLLOW": "black on #56b4e9",
    "PULL_OUT": "black on #f0e442",
    "PASS": "white on #0072b2",
    "RETURN": "black on #e69f00",
    "DONE": "white on #009e73",
    "ABORT": "black on #cc79a7",
    "CRASHED": "white on #d55e00",
}
_BEYOND_SLOW_EDGE = 255
_LINE_ENDS = 2
_MS_PER_S = 1000.0
_STEPS_MS = (100, 200, 250, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000)


def render(run: Trajectories, values: Values, console: Console) -> RenderableType:
    """Draw one simulation.

    Args:
        run: A batch of one simulation.
        values: What `describe` says of it.
        console: Where it will be printed; its width and its characters are respected.
    """
    glyphs = Glyphs.for_terminal(ascii_only=console.options.ascii_only)
    width = min(console.width, MAX_WIDTH)
    shown = _nearest(run)
    return Group(
        *_heading(values, glyphs),
        Text(),
        _vehicle_table(values, shown, glyphs),
        *_section("What the ego did", _stage_bar(values, width, glyphs)),
        *_section(
            "Around the ego (1' is in a lane to its left, 1, to its right)",
            _strip_lines(run, shown, width, glyphs),
        ),
        *_section("Speeds", _speed_lines(run, shown, width, glyphs)),
        *_decisions(values),
        *_ending(values),
    )


def _section(title: str, lines: Iterator[Text]) -> Iterator[Text]:
    """A title with the lines below it, and an empty line above."""
    yield Text()
    yield Text(title, style="bold")
    yield from lines


def _heading(values: Values, glyphs: Glyphs) -> Iterator[RenderableType]:
    """Where and in what weather."""
    facts = (
        f"Simulation {values['simulation']}",
        f"profile {values['profile']}",
        f"seed {values['seed']}",
        f"{values['duration_s']:.2f} s",
        f"{values['num_frames']} frames",
    )
    yield Text(f" {glyphs.separator} ".join(facts), style="bold")
    road, weather = values["road"], values["weather"]
    ids = road["lane_ids"]
    limit_kmh = kmh_from_mps(road["speed_limit_mps"])
    sky = ["night" if weather["night"] else "day"]
    sky += [f"{name} {weather[f'{name}_percent']:.0f} %" for name in ("rain", "fog", "wind")]
    sky += ["low sun ahead"] if weather["horizon_line"] else []
    grid = Table.grid(padding=(0, 2))
    grid.add_row(
        "Road",
        f"{road['name']}, lanes {ids[0]} (slow) to {ids[-1]} (fast), limit {limit_kmh:.0f} km/h, "
        f"{road['driving_side']}-hand traffic",
    )
    grid.add_row("Weather", f"{weather['preset'] or 'drawn freely'}: {', '.join(sky)}")
    grid.add_row("Trace", Text(values["trace_hash"], style="dim"))
    yield grid


def _nearest(run: Trajectories) -> np.ndarray:
    """Slots of the ego and of those that came closest to it, the ego first."""
    slots = present(run)
    s = run.states.s[0, :, : run.num_frames[0]]
    closest = np.abs(s[slots] - s[Role.EGO]).min(axis=1)
    return np.sort(slots[np.argsort(closest, kind="stable")][:MAX_VEHICLES])


def _table(*columns: str) -> Table:
    """An empty table without lines; a column whose name ends in ">" is aligned to the right."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="underline")
    for name in columns:
        table.add_column(Text(name.rstrip(">")), justify="right" if name[-1:] == ">" else "left")
    return table


def _vehicle_table(values: Values, shown: np.ndarray, glyphs: Glyphs) -> Table:
    """Who was there, and how everybody began."""
    columns = ("", "vehicle", "size m>", "mass kg>", "lane>", "ahead m>", "km/h>", "wants>")
    table = _table(*columns)
    ego = values["vehicles"][Role.EGO]
    for one in values["vehicles"]:
        if one["vehicle"] not in shown:
            continue
        is_ego = one is ego
        table.add_row(
            symbol(one["vehicle"]),
            f"{one['colour']} {one['kind']}",
            glyphs.times.join(f"{one[f'{name}_m']:.1f}" for name in ("length", "width")),
            f"{one['mass_kg']:.0f}",
            str(one["start_lane_id"]),
            "ego" if is_ego else f"{one['start_s_m'] - ego['start_s_m']:+.1f}",
            f"{kmh_from_mps(one['start_speed_mps']):.0f}",
            f"{kmh_from_mps(one['desired_speed_mps']):.0f}",
            style="bold" if is_ego else None,
        )
    left_out = len(values["vehicles"]) - len(shown)
    if left_out:
        table.add_row("", f"and {left_out} farther away")
    return table


def _stage_bar(values: Values, width: int, glyphs: Glyphs) -> Iterator[Text]:
    """The ego's stages as one bar, in proportion to their durations, and the same in numbers."""
    stages = values["stages"]
    lengths = bar_lengths([one["to_s"] - one["from_s"] for one in stages], width - _LINE_ENDS)
    bar = Text(glyphs.edge)
    for one, length in zip(stages, lengths, strict=True):
        word = centred(_words(one["stage"]), length - 1, glyphs.line)
        bar.append(word, style=STAGE_STYLES[one["stage"]])
        bar.append(glyphs.edge)
    yield bar
    spans = [
        f"{_words(one['stage'])} {one['from_s']:.2f}{glyphs.dash}{one['to_s']:.2f} s"
        for one in stages
    ]
    yield Text(", ".join(spans))


def _words(name: str) -> str:
    """The name of a stage or decision as a person writes it."""
    return name.lower().replace("_", " ")


def _instants(run: Trajectories) -> np.ndarray:
    """Frames to draw: round steps of time, and the last frame."""
    last = int(run.num_frames[0]) - 1
    duration_ms = int(run.time_ms[last])
    step_ms = next(step for step in _STEPS_MS if duration_ms <= step * MAX_INSTANTS)
    wanted = np.arange(0, duration_ms, step_ms) // run.scenario.frame_interval_ms
    return np.unique(np.append(wanted, last))


def _strip(run: Trajectories, shown: np.ndarray, frames: np.ndarray) -> Strip:
    """Positions and lanes relative to the ego at the frames to draw."""
    s = run.states.s[0][:, frames] * METRES_PER_STEP
    position = s[shown] - s[Role.EGO]
    code = run.states.lane[0][:, frames].astype(int)
    lane = np.where(code == _BEYOND_SLOW_EDGE, -1, code)
    return Strip(
        position=position,
        lane=(lane[shown] - lane[Role.EGO]) * int(run.road.side),
        slots=shown,
        reach=nice_reach(np.abs(position[shown != Role.EGO])),
    )


def _strip_lines(
    run: Trajectories, shown: np.ndarray, width: int, glyphs: Glyphs
) -> Iterator[Text]:
    """Time runs downwards, travel to the right."""
    frames = _instants(run)
    strip = _strip(run, shown, frames)
    inner = width - len(f"{0:6.2f} s {glyphs.edge}") - len(f"{glyphs.edge}   -7  123 pull out")
    ends = f"{strip.reach:.0f} m behind", f"{strip.reach:.0f} m ahead"
    scale = ends[0] + "ego".center(inner - 2)[len(ends[0]) :][: -len(ends[1])] + ends[1]
    header = f"{'time':>8}  {scale:<{inner}}  {'lane':>4} km/h stage"
    yield Text(header, style="underline")
    for frame, line in zip(frames.tolist(), strip.lines(inner, glyphs), strict=True):
        lane = lane_name(run.road, int(run.states.lane[0, Role.EGO, frame]))
        speed = run.states.speed[0, Role.EGO, frame] * METRES_PER_SECOND_PER_STEP
        stage = Stage(int(run.stage[0, frame])).name
        edge = Text(glyphs.edge, style=STAGE_STYLES[stage])
        yield Text.assemble(
            f"{run.time_ms[frame] / _MS_PER_S:6.2f} s ",
            edge,
            line,
            edge,
            f" {lane:>4} {kmh_from_mps(speed):4.0f} {_words(stage)}",
        )


def _speed_lines(
    run: Trajectories, shown: np.ndarray, width: int, glyphs: Glyphs
) -> Iterator[Text]:
    """One sparkline for each vehicle, all of the same scale."""
    recorded = run.states.speed[0, shown, : run.num_frames[0]] * METRES_PER_SECOND_PER_STEP
    speeds = np.asarray(kmh_from_mps(recorded))
    low, high = float(speeds.min()), float(speeds.max())
    inner = width - len(f"E  123 {glyphs.arrow} 123 km/h, 123{glyphs.dash}123") - 1
    for slot, of_one in zip(shown.tolist(), speeds, strict=True):
        line = sparkline(of_one, width=inner, low=low, high=high, glyphs=glyphs)
        yield Text(
            f"{symbol(slot)} {line} {of_one[0]:3.0f} {glyphs.arrow} {of_one[-1]:3.0f} km/h, "
            f"{of_one.min():.0f}{glyphs.dash}{of_one.max():.0f}",
            style="bold" if slot == Role.EGO else "",
        )


def _decisions(values: Values) -> Iterator[RenderableType]:
    """What the ego believed when it decided, the truth in brackets."""
    if not values["decisions"]:
        return
    table = _table("time", "decision", "leader", "ahead in new lane", "behind in new lane")
    for one in values["decisions"]:
        table.add_row(
            f"{one['time_s']:.2f} s",
            _words(one["kind"]),
            *(_percept(neighbour) for neighbour in one["neighbours"].values()),
        )
    yield Text()
    yield Text("What the ego believed: gap, closing speed (and what was true)", style="bold")
    yield table


def _percept(neighbour: Values | None) -> str:
    """One neighbour as believed and as it was."""
    if neighbour is None:
        return "nobody"
    who = "?" if neighbour["vehicle"] is None else symbol(neighbour["vehicle"])
    gap, gap_true = neighbour["gap_m"], neighbour["true_gap_m"]
    closing, closing_true = neighbour["closing_speed_mps"], neighbour["true_closing_speed_mps"]
    if gap is None:
        return f"{who} not seen\n({gap_true:.0f} m, {kmh_from_mps(closing_true):+.0f} km/h)"
    truth = ("", "")
    if gap_true is not None:
        truth = (f" ({gap_true:.0f})", f" ({kmh_from_mps(closing_true):+.0f})")
    return f"{who} {gap:.0f}{truth[0]} m,\n{kmh_from_mps(closing):+.0f}{truth[1]} km/h"


def _ending(values: Values) -> Iterator[Text]:
    """The collisions, or that there was none."""
    yield Text()
    if not values["collisions"]:
        yield Text(
            f"No collision; the last stage of the ego: {_words(values['stages'][-1]['stage'])}."
        )
    for one in values["collisions"]:
        pair = " and ".join(symbol(slot) for slot in one["vehicles"])
        yield Text(
            f"Collision of {pair} at {one['time_s']:.2f} s: "
            f"impulse {one['impulse_newton_s']} N s, "
            f"closing at {kmh_from_mps(one['closing_speed_mps']):.0f} km/h",
            style="bold",
        )
