"""One simulation on a terminal: vehicles, actions and beliefs of the ego, outcome, law."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rich.console import Group
from rich.text import Text

from overtaking.cli.drawing import (
    Glyphs,
    Strip,
    nice_reach,
    sparkline,
)
from overtaking.cli.law import law_lines
from overtaking.cli.tables import FittingTable, open_table
from overtaking.cli.timeline import STAGE_STYLES, event_lines, stage_times, time_line
from overtaking.core.units import kmh_from_mps
from overtaking.knowledge.glossary import terms
from overtaking.model.trajectories import POSITION_RESOLUTION, SPEED_RESOLUTION, Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.show.description import lane_name
from overtaking.show.wording import (
    ending_words,
    outcome_words,
    percept_words,
    road_words,
    symbol,
    vehicle_words,
    weather_words,
    words,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.console import Console, RenderableType

    from overtaking.model.trajectories import Trajectories
    from overtaking.show.judgement import Values

MAX_WIDTH = 110
MAX_VEHICLES = 9
MAX_INSTANTS = 20
_BEYOND_SLOW_EDGE = 255
_FAR = 2**31 - 1
"""Farther than any vehicle [mm]."""
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
        *_section("What the ego did", time_line(values, width, glyphs)),
        Text(),
        *stage_times(values, glyphs),
        *event_lines(values),
        *_section(
            "Around the ego (1' is in a lane to its left, 1, to its right)",
            _strip_lines(run, shown, width, glyphs),
        ),
        *_section("Speeds", _speed_lines(run, shown, width, glyphs)),
        *_decisions(values),
        *_section("How it ended", _ending(values)),
        Text(),
        *law_lines(values, width, glyphs),
        Text(),
        Text("What a word means: overtaking glossary WORD", style="dim"),
    )


def _section(title: str, lines: Iterator[Text]) -> Iterator[Text]:
    """A title with the lines below it, and an empty line above."""
    yield Text()
    yield Text(title, style="bold")
    yield from lines


def _heading(values: Values, glyphs: Glyphs) -> Iterator[RenderableType]:
    """Facts, road, weather, outcome and classes."""
    facts = (
        f"Simulation {values['simulation']}",
        f"profile {values['profile']}",
        f"seed {values['seed']}",
        f"{values['duration_s']:.2f} s",
        f"{values['num_frames']} frames",
    )
    yield Text(f" {glyphs.separator} ".join(facts), style="bold")
    grid = open_table("", "")
    grid.add_row("Road", road_words(values["road"]))
    grid.add_row("Weather", weather_words(values["weather"]))
    grid.add_row("Outcome", Text(outcome_words(values), style="bold"))
    default = values["policy"]
    others = [name for name in values["policies"] if name != default]
    classes = (f"{values['policies'][name]['class']} under {name}" for name in (default, *others))
    grid.add_row("Class", ", ".join(classes))
    for name in dict.fromkeys(one["class"] for one in values["policies"].values()):
        grid.add_row("", Text(f"{name}: {terms('classes')[name].meaning}", style="dim"))
    if values["not_recorded"]:
        grid.add_row("Unknown", ", ".join(words(name) for name in values["not_recorded"]))
    grid.add_row("Trace", Text(values["trace_hash"], style="dim"))
    yield grid


def _nearest(run: Trajectories) -> np.ndarray:
    """Slots of the ego and of those that came closest to it, the ego first."""
    slots = np.flatnonzero(run.scenario.vehicles.valid[0])
    s = run.states.s[0, :, : run.num_frames[0]]
    away = np.where(run.state_mask[0, slots, : run.num_frames[0]], s[slots] - s[EGO_SLOT], _FAR)
    closest = np.abs(away).min(axis=1)
    return np.sort(slots[np.argsort(closest, kind="stable")][:MAX_VEHICLES])


def _vehicle_table(values: Values, shown: np.ndarray, glyphs: Glyphs) -> FittingTable:
    """The vehicles and their starts."""
    columns = ("", "vehicle", "size m>", "mass kg>", "lane>", "ahead m>", "km/h>", "wants>")
    table = open_table(*columns)
    ego = values["vehicles"][EGO_SLOT]
    for one in values["vehicles"]:
        if one["vehicle"] not in shown:
            continue
        is_ego = one is ego
        table.add_row(
            symbol(one["vehicle"]),
            vehicle_words(one),
            glyphs.times.join(f"{one[f'{name}_m']:.1f}" for name in ("length", "width")),
            _number(one["mass_kg"]),
            _start_lane(one, values["road"]),
            "ego" if is_ego else _ahead(one, ego),
            f"{kmh_from_mps(one['start_speed_mps']):.0f}",
            _kmh(one["desired_speed_mps"]),
            style="bold" if is_ego else "",
        )
    left_out = len(values["vehicles"]) - len(shown)
    if left_out:
        table.add_row("", f"and {left_out} farther away")
    return table


def _start_lane(one: Values, road: Values) -> str:
    """Lane in which a vehicle starts, and whether it comes the other way there."""
    lane = one["start_lane_id"]
    comes = road.get("is_two_way") and lane not in road["lane_ids"]
    return f"{lane} comes" if comes else str(lane)


def _ahead(one: Values, ego: Values) -> str:
    """Start of a vehicle relative to the ego, or the time at which it appears."""
    if one["from_s"] > ego["from_s"]:
        return f"at {one['from_s']:.1f} s"
    return f"{one['start_s_m'] - ego['start_s_m']:+.1f}"


def _number(value: float | None) -> str:
    """A number without decimals, a question mark where it is unknown."""
    return "?" if value is None else f"{value:.0f}"


def _kmh(speed_mps: float | None) -> str:
    return _number(None if speed_mps is None else kmh_from_mps(speed_mps))


def _instants(run: Trajectories) -> np.ndarray:
    """Frames to draw: round steps of time, and the last frame."""
    last = int(run.num_frames[0]) - 1
    duration_ms = int(run.time_ms[last])
    step_ms = next(step for step in _STEPS_MS if duration_ms <= step * MAX_INSTANTS)
    wanted = np.arange(0, duration_ms, step_ms) // run.scenario.frame_interval_ms
    return np.unique(np.append(wanted, last))


def _strip(run: Trajectories, shown: np.ndarray, frames: np.ndarray) -> Strip:
    """Positions and lanes relative to the ego at the frames to draw."""
    s = run.states.s[0][:, frames] * POSITION_RESOLUTION
    position = s[shown] - s[EGO_SLOT]
    code = run.states.lane[0][:, frames].astype(int)
    lane = np.where(code == _BEYOND_SLOW_EDGE, -1, code)
    there = run.state_mask[0, shown][:, frames]
    others = shown != EGO_SLOT
    return Strip(
        position=np.where(there, position, _FAR * POSITION_RESOLUTION),
        lane=(lane[shown] - lane[EGO_SLOT]) * int(run.road.overtaking_sign),
        slots=shown,
        reach=nice_reach(_filled(np.abs(position[others]), there[others])),
    )


def _filled(distance: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Distances (vehicle, instant), each vehicle's mean where it was not recorded [m]."""
    count = there.sum(axis=1)
    mean = np.where(there, distance, 0.0).sum(axis=1) / np.maximum(count, 1)
    mean[count == 0] = _FAR * POSITION_RESOLUTION
    return np.where(there, distance, mean[:, None])


def _strip_lines(
    run: Trajectories, shown: np.ndarray, width: int, glyphs: Glyphs
) -> Iterator[Text]:
    """Time runs downwards, travel to the right."""
    frames = _instants(run)
    strip = _strip(run, shown, frames)
    inner = width - len(f"{0:6.2f} s {glyphs.edge}") - len(f"{glyphs.edge}   -7  123 pull out")
    ends = f"{strip.reach:.0f} m behind", f"{strip.reach:.0f} m ahead"
    scale = ends[0] + "ego".center(inner - 2)[len(ends[0]) :][: -len(ends[1])] + ends[1]
    recorded = "stage" not in run.unknown
    header = f"{'time':>8}  {scale:<{inner}}  {'lane':>4} km/h" + (" stage" if recorded else "")
    yield Text(header, style="underline")
    for frame, line in zip(frames.tolist(), strip.lines(inner, glyphs), strict=True):
        lane = lane_name(run.road, int(run.states.lane[0, EGO_SLOT, frame]))
        speed = run.states.speed[0, EGO_SLOT, frame] * SPEED_RESOLUTION
        stage = Stage(int(run.stage[0, frame])).name
        edge = Text(glyphs.edge, style=STAGE_STYLES[stage] if recorded else "")
        yield Text.assemble(
            f"{run.time_ms[frame] / _MS_PER_S:6.2f} s ",
            edge,
            line,
            edge,
            f" {lane:>4} {kmh_from_mps(speed):4.0f}",
            f" {words(stage)}" if recorded else "",
        )


def _speed_lines(
    run: Trajectories, shown: np.ndarray, width: int, glyphs: Glyphs
) -> Iterator[Text]:
    """One sparkline for each vehicle, all of the same scale."""
    frames = slice(run.num_frames[0])
    there = run.state_mask[0, shown, frames]
    recorded = run.states.speed[0, shown, frames] * SPEED_RESOLUTION
    speeds = np.asarray(kmh_from_mps(recorded))
    low, high = float(speeds[there].min()), float(speeds[there].max())
    inner = width - len(f"E  123 {glyphs.arrow} 123 km/h, 123{glyphs.dash}123") - 1
    for slot, of_all, valid in zip(shown.tolist(), speeds, there, strict=True):
        of_one = of_all[valid]
        line = sparkline(of_one, width=inner, low=low, high=high, glyphs=glyphs)
        yield Text(
            f"{symbol(slot)} {line} {of_one[0]:3.0f} {glyphs.arrow} {of_one[-1]:3.0f} km/h, "
            f"{of_one.min():.0f}{glyphs.dash}{of_one.max():.0f}",
            style="bold" if slot == EGO_SLOT else "",
        )


def _decisions(values: Values) -> Iterator[RenderableType]:
    """Beliefs of the ego at each decision, true values in brackets, and the verdict of the law."""
    if not values["decisions"]:
        return
    columns = ("time", "to", "of whom", "gap m>", "closing km/h>", "the law")
    table = open_table(*columns)
    for one in values["decisions"]:
        near = [(index, of) for index, of in one["neighbours"].items() if of is not None]
        rows = [percept_words(index, of) for index, of in near] or [("no vehicle near",)]
        for number, row in enumerate(rows):
            first = ("", "") if number else (f"{one['time_s']:.2f} s", words(one["kind"]))
            table.add_row(*first, *row)
    yield Text()
    yield Text("What the driver believed when deciding (and what was true)", style="bold")
    yield table


def _ending(values: Values) -> Iterator[Text]:
    """The outcome, and the collisions, or that there was none."""
    for index, line in enumerate(ending_words(values)):
        yield Text(line, style="bold" if index else "")
