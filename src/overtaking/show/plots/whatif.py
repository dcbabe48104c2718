"""Twins over time, and the futures of a simulation over its scene."""

from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from overtaking.analysis.stats.diagrams import diagram
from overtaking.analysis.whatif.fan import TOO_FEW, Fan
from overtaking.analysis.whatif.scenes import class_of
from overtaking.analysis.whatif.twin import Twin
from overtaking.core.arrays import F64
from overtaking.core.units import kmh_from_mps
from overtaking.labels.labelling import label
from overtaking.labels.law.judging import choose_policy
from overtaking.model.vehicle_tracks import EGO_ROW, VehicleTracks
from overtaking.model.verdicts import OvertakeClass
from overtaking.show import palette
from overtaking.show.futures import fan_title
from overtaking.show.plots.overtake import draw_along
from overtaking.show.plots.style import is_narrow, lightened, new_figure, remark, styled, words

_HEADING_LETTERS = 48  # Letters per line of the heading, in narrow figures.
_TITLE_LETTERS = 32  # Letters per line of a title above a panel, in narrow figures.
_LOOKS = (
    {"color": palette.INK, "linewidth": 1.6, "linestyle": (0, (4, 1.5)), "zorder": 3},
    {"color": palette.ACCENT, "linewidth": 1.8, "linestyle": "-", "zorder": 2},
)
"""The simulation as it was lies above its twin: while they are one, both are seen."""


@styled
def draw_twin(twin: Twin, policy: str | None = None) -> Figure:
    """Place across the road, speed of the ego and gap to its target, of both.

    Args:
        twin: The twins.
        policy: Which rules decide about the classes that the legend names; None for the default of
            the profile.
    """
    policy = choose_policy(policy, twin.profile)
    figure = new_figure(5.0)
    across, speed, gap = figure.subplots(3, 1, sharex=True)
    for simulation, labelled, look in zip(twin.told, twin.labelled, _LOOKS, strict=True):
        tracks = VehicleTracks.from_trajectories(simulation.run, events=twin.labelled[0].events)
        sign = int(simulation.run.road.overtaking_sign)
        name = f"{simulation.title}: {words(class_of(labelled, policy))}"
        ego_d = tracks.d[EGO_ROW]
        across.plot(tracks.time, (ego_d - ego_d[0]) * sign, label=name, **look)
        speed.plot(tracks.time, kmh_from_mps(tracks.speed[EGO_ROW]), **look)
        if tracks.target is not None:
            gap.plot(tracks.time, _target_lead(tracks, tracks.target), **look)
    across.set_ylabel("ego from its\nstart across [m]")
    speed.set_ylabel("speed of\nthe ego [km/h]")
    gap.set_ylabel("target ahead,\ncentre to centre [m]")
    gap.set_xlabel("time [s]")
    _mark_parting(twin, (across, speed, gap))
    heading = f"{_heading(twin)}; classes under the policy {policy}"
    columns, heading = (1, fill(heading, _HEADING_LETTERS)) if is_narrow() else (2, heading)
    figure.legend(loc="outside upper left", ncols=columns, title=heading, alignment="left")
    figure.align_ylabels([across, speed, gap])
    return figure


def _heading(one: Twin) -> str:
    since = f"from {one.since:.2f} s on" if one.effect == "direct" else "drawn again from the start"
    return f"Simulation {one.number} and its twin, {one.effect} effect, {since}"


def _target_lead(tracks: VehicleTracks, target: int) -> F64:
    """Station of the target minus that of the ego, NaN where the target is not recorded [m]."""
    lead = tracks.s[target] - tracks.s[EGO_ROW]
    return np.where(tracks.is_recorded[target], lead, np.nan)


def _mark_parting(one: Twin, panels: tuple[Axes, ...]) -> None:
    """A line where the two part."""
    if one.parting is None:
        remark(panels[0], "they never part")
        return
    for axes in panels:
        axes.axvline(one.parting.time, color=palette.QUIET, linewidth=0.9, linestyle=":")
    text = f"they part at {one.parting.time:.2f} s"
    if one.parting.ego_time is not None and one.parting.ego_time > one.parting.time:
        text += f",{chr(10) if is_narrow() else ' '}the ego at {one.parting.ego_time:.2f} s"
    remark(panels[0], text)


@styled
def draw_fan(one: Fan) -> Figure:
    """Shares of the classes over the instant of the start, below the scene of these instants."""
    figure = new_figure(5.2)
    scene, shares = figure.subplots(2, 1, sharex=True, height_ratios=(1.0, 1.15))
    draw_along(scene, diagram(one.stayed, label(one.stayed).events), palette.ACCENT)
    scene.grid(visible=False)
    gap = "\n" if is_narrow() else " "
    scene.set_title(f"Simulation {one.number},{gap}had the ego stayed in its lane")
    _draw_shares(shares, one)
    interval = one.stayed.scenario.frame_interval_ms / 1000.0
    for axes in (scene, shares):
        if one.actual is not None:
            axes.axvline(one.actual, color=palette.INK, linewidth=1.0, linestyle=(0, (3, 2)))
        axes.set_xlim(0.0, max(int(one.stayed.num_frames[0]) - 1, 1) * interval)
    if one.actual is not None:
        shares.annotate(
            "began", (one.actual, 1.02), xycoords=("data", "axes fraction"), ha="center", size=8
        )
    lacking = int((~one.is_enough).sum())
    note = f"\n{lacking} of {len(one.time)} instants with fewer than {TOO_FEW} futures left out"
    shares.set_xlabel(f"time at which the ego is told to begin [s]{note if lacking else ''}")
    figure.align_ylabels([scene, shares])
    return figure


def _draw_shares(axes: Axes, one: Fan) -> None:
    """A line with its 95 % interval for each class that occurs."""
    for code in OvertakeClass:
        if not one.counts[:, code].any():
            continue
        colour = palette.CLASS_COLOURS[code.title]
        limits = one.interval(code)
        axes.fill_between(
            one.time, limits[:, 0], limits[:, 1], color=lightened(colour, 0.25), linewidth=0,
            alpha=0.7, zorder=1,
        )  # fmt: skip
        marker = palette.CLASS_MARKERS[code.title]
        axes.plot(
            one.time, one.shares[:, code], color=colour, marker=marker, markersize=3.5,
            linewidth=1.4, label=words(code.title), zorder=3,
        )  # fmt: skip
    axes.set_ylim(-0.02, 1.02)
    axes.set_ylabel(f"share, 95 % interval\n(policy {one.policy})")
    title = fan_title(one.condition_on)
    axes.set_title(fill(title, _TITLE_LETTERS) if is_narrow() else title, pad=16)
    if one.counts.any():
        if is_narrow():
            axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.35), ncols=2)
        else:
            axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
