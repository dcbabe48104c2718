"""Twins, fans and sufficient changes of a small data set, held against simulations of their own."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest

import overtaking as ot
from overtaking.analysis.whatif.beliefs import Percept, proposals
from overtaking.analysis.whatif.enough import ACCIDENTS, enough_of
from overtaking.analysis.whatif.fan import TOO_FEW
from overtaking.analysis.whatif.futures import copies, started
from overtaking.analysis.whatif.scenes import Scene, class_of, pull_out, scene_of
from overtaking.core.errors import ConfigError
from overtaking.model.trajectories import (
    PerceivedVehicle,
    Stage,
)
from overtaking.model.verdicts import OvertakeClass
from overtaking.show.video.twin import TwinFilm
from overtaking.show.video.view import SCENE_BOTTOM

pytestmark = pytest.mark.ci

GOLDEN = Path(__file__).parents[3] / "golden"

WET = {"weather.presets": ["HardRainNoon"], "traffic.vehicles": "4..6"}
STARTS = (
    ot.Intervention(decision=ot.ForcedDecision.STAY),
    ot.Intervention(frame=40, decision=ot.ForcedDecision.PULL_OUT),
)
"""What a future of a start at frame 40 lets the ego do."""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> ot.Dataset:
    """A few simulations in hard rain."""
    place = tmp_path_factory.mktemp("whatif") / "data"
    return ot.generate_dataset(
        "pinto2023-physical", num_simulations=16, seed=7, out=place, overrides=WET
    )


@pytest.fixture(scope="module")
def begun(data: ot.Dataset) -> int:
    """A simulation in which the ego pulls out after a second."""
    starts = [pull_out(data[number]) for number in range(len(data))]
    return next(k for k, frame in enumerate(starts) if frame is not None and frame > 20)


def test_a_twin_with_nothing_changed_has_the_same_hash(data: ot.Dataset, begun: int):
    for wish in ({}, {"without": ["fog"]}, {"delay": 0.0}):
        found = ot.whatif.counterfactual(data, begun, **wish)
        assert found.parting is None
        hashes = [one.run.trace_hash for one in found.told]
        np.testing.assert_array_equal(*hashes)
    total = ot.whatif.counterfactual(data, begun, without=["fog"], effect="total")
    np.testing.assert_array_equal(total.told[1].run.trace_hash, data[begun].trace_hash)


def test_direct_and_total_effects_differ_in_the_start(data: ot.Dataset, begun: int):
    direct = ot.whatif.counterfactual(data, begun, without=["rain"])
    total = ot.whatif.counterfactual(data, begun, without=["rain"], effect="total")
    assert (direct.effect, total.effect) == ("direct", "total")
    was = data[begun].states.s[0, :, 0]
    np.testing.assert_array_equal(direct.told[1].run.states.s[0, : len(was), 0], was)
    whole = ot.sample(
        "pinto2023-physical", num_simulations=1, seed=7, first_scenario=begun, overrides=WET
    )
    drawn = total.told[1].run.scenario
    slots = whole.num_slots
    # The same people and bodies were drawn; where they start may differ.
    np.testing.assert_array_equal(drawn.vehicles.mass[:, :slots], whole.vehicles.mass)
    np.testing.assert_array_equal(drawn.drivers.time_gap[:, :slots], whole.drivers.time_gap)
    assert not drawn.weather.rain.any()


def test_the_frame_of_the_parting_is_the_first_that_differs(data: ot.Dataset, begun: int):
    found = ot.whatif.counterfactual(data, begun, without=["rain"], start_time=1.0)
    assert found.parting is not None
    one, two = (told.run.states for told in found.told)
    frame = found.parting.frame
    assert frame > 20
    for name in one.__slots__:
        if name != "lights":
            assert (getattr(one, name)[..., :frame] == getattr(two, name)[..., :frame]).all()
    assert found.lamps == 1.0
    value = getattr(two, found.parting.quantity)[0, found.parting.vehicle, frame]
    assert value != getattr(one, found.parting.quantity)[0, found.parting.vehicle, frame]


def test_an_ego_that_stays_begins_no_later_overtake(data: ot.Dataset, begun: int):
    with pytest.raises(ConfigError, match="either an ego that stays in its lane or a later begin"):
        ot.whatif.counterfactual(data, begun, stay=True, delay=1.0)


@pytest.mark.parametrize("delay", [0.3, 1.0, 2.5])
def test_a_later_start_is_as_late_as_asked(data: ot.Dataset, begun: int, delay: float):
    run = ot.whatif.counterfactual(data, begun, delay=delay).told[1].run
    before, after = pull_out(data[begun]), pull_out(run)
    assert before is not None
    assert after is not None
    assert after - before - round(delay * 20) in (0, 1)


def test_who_stays_never_begins(data: ot.Dataset, begun: int):
    assert pull_out(ot.whatif.counterfactual(data, begun, stay=True).told[1].run) is None


def test_a_careful_driver_has_the_traits_of_a_careful_driving_style(data: ot.Dataset, begun: int):
    found = ot.whatif.counterfactual(data, begun, driving_style="careful")
    branched = found.told[1].run.branch_origin
    assert branched is not None
    (change,) = branched.interventions
    careful = WET | {"drivers.driving_style": [0.0, 0.0]}
    drivers = ot.sample(
        "pinto2023-physical", num_simulations=1, seed=7, first_scenario=begun, overrides=careful
    ).drivers
    assert set(change.traits) == set(drivers.__slots__)
    for name, value in change.traits.items():
        assert value == getattr(drivers, name)[0, 0]


def test_what_cannot_be_drawn_again_is_refused(data: ot.Dataset, begun: int):
    for wish in ({"stay": True}, {"delay": 1.0}, {"without": ["rain"], "start_time": 1.0}):
        with pytest.raises(ConfigError, match="total effect"):
            ot.whatif.counterfactual(data, begun, effect="total", **wish)
    with pytest.raises(ConfigError, match=r"driving_style: expected .*careful"):
        ot.whatif.counterfactual(data, begun, driving_style="brave")


@pytest.mark.parametrize("effect", ["direct", "total"])
def test_saved_twins_are_simulated_again_from_their_manifest(
    data: ot.Dataset, begun: int, tmp_path: Path, effect: str
):
    found = ot.whatif.counterfactual(data, begun, without=["rain"], effect=effect)
    saved = ot.whatif.save_branches(data, found, tmp_path / "twin")
    for number, told in enumerate(found.told):
        again = ot.whatif.resimulate_branch(saved, number)
        np.testing.assert_array_equal(again.trace_hash, told.run.trace_hash)
        np.testing.assert_array_equal(saved[number].trace_hash, told.run.trace_hash)
    table = saved.labels()
    chosen = table[table["policy"] == "paper"]["class"]
    assert list(chosen) == [class_of(one, "paper") for one in found.labelled]
    assert "| 1 |" in (saved.path / "README.md").read_text()
    with pytest.raises(ot.OvertakingError, match="which are written whole"):
        ot.resume_dataset(saved.path)


def test_a_branch_of_a_saved_branch_goes_on_from_it(data: ot.Dataset, begun: int, tmp_path: Path):
    first = ot.whatif.counterfactual(data, begun, without=["rain"])
    saved = ot.whatif.save_branches(data, first, tmp_path / "twin")
    second = ot.whatif.counterfactual(saved, 1, stay=True)
    both = ot.whatif.counterfactual(data, begun, without=["rain"], stay=True)
    np.testing.assert_array_equal(second.told[1].run.trace_hash, both.told[1].run.trace_hash)


def test_a_removed_vehicle_is_in_no_table_of_states(data: ot.Dataset, begun: int, tmp_path: Path):
    gone = ot.branch(data[begun], interventions=[ot.Intervention(frame=30, slot=1, remove=True)])
    saved = ot.whatif.save_branches(data, {"without vehicle 1": gone}, tmp_path / "gone")
    states = saved.states(0)
    assert (states[states["vehicle"] == 1]["frame"] < 30).all()
    np.testing.assert_array_equal(saved[0].state_mask, gone.state_mask)
    np.testing.assert_array_equal(saved[0].states.s, gone.states.s)


def test_the_first_future_has_the_random_numbers_of_the_simulation(data: ot.Dataset, begun: int):
    scene = scene_of(data, begun)
    futures = started(scene.world, 40, copies(scene.world, 40, 8))
    alone = ot.branch(scene.scenario, interventions=STARTS)
    np.testing.assert_array_equal(futures.trace_hash[:1], alone.trace_hash)
    assert len(np.unique(futures.trace_hash, axis=0)) == 8
    for name in futures.states.__slots__:
        values = getattr(futures.states, name)[:, :, :41]
        np.testing.assert_array_equal(values, np.broadcast_to(values[:1], values.shape))


def test_the_changes_of_a_branch_are_made_in_its_futures(
    data: ot.Dataset, begun: int, tmp_path: Path
):
    """Before, at and after the start; what the branch lets the ego do is left out."""
    changes = [
        ot.Intervention(without=("rain",)),
        ot.Intervention(frame=30, slot=2, position_change=15.0, speed_change=-3.0),
        ot.Intervention(frame=40, slot=1, traits={"time_gap": 2.5}),
        ot.Intervention(frame=60, slot=3, remove=True),
    ]
    told = ot.branch(
        data[begun],
        interventions=[*changes, ot.Intervention(frame=25, decision=STARTS[1].decision)],
    )
    saved = ot.whatif.save_branches(data, {"much changed": told}, tmp_path / "much")
    scene = scene_of(saved, 0)
    futures = started(scene.world, 40, copies(scene.world, 40, 3))
    alone = ot.branch(data[begun], interventions=[*changes, *STARTS])
    np.testing.assert_array_equal(futures.trace_hash[:1], alone.trace_hash)
    np.testing.assert_array_equal(
        ot.label(futures).findings.margin[:1], ot.label(alone).findings.margin
    )
    assert not futures.state_mask[:, 3, 60:].any()
    assert futures.scenario.weather.rain[0] == 0.0


def test_a_fan_is_that_of_the_changed_world(data: ot.Dataset, begun: int, tmp_path: Path):
    dry = ot.branch(data[begun], interventions=[ot.Intervention(without=("rain",))])
    stays = ot.branch(data[begun], decision=ot.ForcedDecision.STAY)
    saved = ot.whatif.save_branches(data, {"dry": dry, "stays": stays}, tmp_path / "two")
    was, changed, same = (
        ot.whatif.outcome_fan(one, number, futures=30, interval=2.0)
        for one, number in ((data, begun), (saved, 0), (saved, 1))
    )
    assert same.actual is None
    np.testing.assert_array_equal(same.counts, was.counts)
    assert not np.array_equal(changed.counts, was.counts)
    assert not changed.stayed.scenario.weather.rain.any()


def test_worlds_of_a_belief_agree_with_the_changes_of_a_branch(
    data: ot.Dataset, begun: int, tmp_path: Path
):
    """Who is gone is nowhere, and who was made another person stays that person."""
    changes = [
        ot.Intervention(frame=5, slot=3, remove=True),
        ot.Intervention(frame=10, slot=2, traits={"time_gap": 2.5}),
    ]
    saved = ot.whatif.save_branches(
        data, {"one": ot.branch(data[begun], interventions=changes)}, tmp_path / "one"
    )
    scene = scene_of(saved, 0)
    stayed = scene.branch(ot.Intervention(decision=ot.ForcedDecision.STAY))
    percept = Percept.of(started(scene.world, 20, copies(scene.world, 20, 1)))
    assert percept is not None
    assert 3 not in percept.vehicle[percept.detected]
    many = proposals(scene, stayed, 20, percept, 200)
    assert (many.scenario.start_s[:, 3] < -10_000.0).all()
    drivers = many.scenario.drivers.time_gap
    assert (drivers[:, 2] == 2.5).all()
    assert len(np.unique(drivers[:, 1])) > TOO_FEW
    assert percept.is_shared_by(started(scene.world, 20, many)).sum() > TOO_FEW


def test_a_fan_counts_the_classes_of_its_futures(data: ot.Dataset, begun: int):
    found = ot.whatif.outcome_fan(data, begun, futures=30, interval=2.0)
    assert (found.futures == 30).all()
    scene = scene_of(data, begun)
    frame = round(float(found.time[1]) * 20)
    labels = ot.label(started(scene.world, frame, copies(scene.world, frame, 30))).labels
    for code in OvertakeClass:
        assert found.counts[1, code] == (labels.classes[:, 0] == code).sum()
        known = binomtest(int(found.counts[1, code]), 30).proportion_ci(method="wilson")
        np.testing.assert_allclose(found.interval(code)[1], (known.low, known.high), atol=1e-6)
    few = ot.whatif.outcome_fan(data, begun, futures=TOO_FEW - 1, interval=5.0)
    assert np.isnan(few.shares).all()


def test_worlds_of_a_belief_differ_in_what_the_ego_does_not_know(data: ot.Dataset, begun: int):
    scene = scene_of(data, begun)
    stayed = scene.branch(ot.Intervention(decision=ot.ForcedDecision.STAY))
    percept = Percept.of(started(scene.world, 20, copies(scene.world, 20, 1)))
    assert percept is not None
    many = proposals(scene, stayed, 20, percept, 200)
    run = started(scene.world, 20, many)
    kept = run.select(percept.is_shared_by(run))
    assert kept.scenario.num_simulations > TOO_FEW
    for place, seen in enumerate(percept.detected):
        np.testing.assert_array_equal(kept.percepts.is_detected[:, 0, place], seen)
    drivers = kept.scenario.drivers
    assert (drivers.time_gap[:, 0] == drivers.time_gap[0, 0]).all()
    assert len(np.unique(drivers.time_gap[:, 1])) > TOO_FEW
    # What is noticed lies where the ego's errors would have it, not where it is.
    gaps = kept.percepts.true_gap[:, 0, PerceivedVehicle.LEADER] * 1e-3
    if percept.detected[0]:
        assert np.std(gaps) > 0.1
        believed = percept.gap[PerceivedVehicle.LEADER]
        mean = np.mean(kept.percepts.gap[:, 0, PerceivedVehicle.LEADER] * 1e-3)
        assert abs(mean - believed) < 0.1 * believed


@pytest.mark.parametrize("frame", [0, 1])
def test_the_ego_errs_in_a_proposed_world_as_the_proposal_assumes(data: ot.Dataset, frame: int):
    # A proposal places a noticed leader so that the ego believes the gap of the percept. The
    # standard error of the ego's judgement of distances is some 15 %.
    scene = scene_of(data, 0)
    stayed = scene.branch(ot.Intervention(decision=ot.ForcedDecision.STAY))
    percept = Percept.of(started(scene.world, frame, copies(scene.world, frame, 1)))
    assert percept is not None
    assert percept.detected[PerceivedVehicle.LEADER]
    run = started(scene.world, frame, proposals(scene, stayed, frame, percept, 200))
    gaps = run.percepts.gap[:, 0, PerceivedVehicle.LEADER] * 1e-3
    assert np.std(gaps / percept.gap[PerceivedVehicle.LEADER]) < 0.05


def test_each_sufficient_change_is_confirmed_by_a_simulation(data: ot.Dataset):
    table = data.labels()
    paper = table[table["policy"] == "paper"]
    numbers = paper[paper["class"] == "Success_I"]["simulation"].tolist()
    confirmed = 0
    for number in numbers[:3]:
        found = ot.whatif.sufficient_changes(data, number)
        assert found.was == "Success_I"
        for one in found.found:
            if one.least is None or not one.name.startswith("ego: time gap wanted"):
                continue
            scenario = data.scenario(number)
            value = float(scenario.drivers.time_gap[0, 0]) + one.least
            run = ot.branch(scenario, interventions=[ot.Intervention(traits={"time_gap": value})])
            assert class_of(ot.label(run), "paper") == one.becomes == "Success_L"
        confirmed += sum(one.least is not None for one in found.found)
        assert all(math.isnan(one.larger) or 0 <= one.larger <= 1 for one in found.found)
    assert confirmed


def test_who_knows_what_a_pass_takes_would_not_have_collided(data: ot.Dataset):
    scenes = json.loads((GOLDEN / "trace_hashes.json").read_text(encoding="utf-8"))
    one = next(scene for scene in scenes if scene["name"] == "rural-head-on-collision")
    drawn = ot.sample(
        "rural",
        num_simulations=1,
        seed=one["seed"],
        first_scenario=one["index"],
        overrides=one["overrides"],
    )
    scene = Scene(data=data, number=0, run=ot.simulate(drawn))
    found = {each.name: each for each in enough_of(scene, goal="safe").found}
    least = found["ego: time believed for a pass, over what it takes"].least
    assert least is not None
    assert least > 0.0
    value = float(drawn.drivers.passing_time_factor[0, 0]) + least
    run = ot.branch(drawn, interventions=[ot.Intervention(traits={"passing_time_factor": value})])
    assert class_of(ot.label(run), "paper") not in [kind.title for kind in ACCIDENTS]


def test_a_goal_that_is_reached_is_refused(data: ot.Dataset, begun: int):
    table = data.labels()
    paper = table[table["policy"] == "paper"].set_index("simulation")["class"]
    safe = next(k for k, name in paper.items() if name not in [one.title for one in ACCIDENTS])
    with pytest.raises(ConfigError, match="expected one that was not safe"):
        ot.whatif.sufficient_changes(data, int(safe), goal="safe")


def test_recorded_and_driven_simulations_are_refused(tmp_path: Path):
    def patient(observation: ot.Observation) -> np.ndarray:
        return np.zeros((len(observation.is_running), 2))

    driver = ot.Driver(function=patient, observation="truth")
    data = ot.generate_dataset(
        "pinto2023-physical", num_simulations=1, seed=1, out=tmp_path / "driven", driver=driver
    )
    with pytest.raises(ConfigError, match="expected simulations of this package's drivers"):
        ot.whatif.counterfactual(data, 0, stay=True)


def test_twins_are_filmed_one_above_the_other(data: ot.Dataset, begun: int, tmp_path: Path):
    av = pytest.importorskip("av")
    found = ot.whatif.counterfactual(data, begun, delay=1.0)
    path = ot.film(found, tmp_path / "twin.mp4")
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        longest = max(int(told.run.num_frames[0]) for told in found.told)
        assert (stream.width, stream.height, stream.frames) == (1280, 832, longest)
        first = next(film.decode(video=0)).to_ndarray(format="rgb24").astype(int)
    # Before they part both halves show the same road.
    assert np.abs(first[60:270] - first[492:702]).mean() < 2.0


def test_films_of_twins_have_one_time_axis(data: ot.Dataset, begun: int):
    found = ot.whatif.counterfactual(data, begun, stay=True)
    frames = [int(told.run.num_frames[0]) for told in found.told]
    assert min(frames) < max(frames)
    picture = TwinFilm(found).draw(min(frames) - 1).to_rgb().astype(int)
    # The cursor is the column that is bright in every row of the curves.
    strips = [picture[top + SCENE_BOTTOM + 12 : top + SCENE_BOTTOM + 90] for top in (0, 432)]
    above, below = [int(strip.sum(axis=2).min(axis=0).argmax()) for strip in strips]
    assert above == below


@pytest.mark.parametrize("name", ["twin.svg", "twin.pdf", "twin.png"])
def test_twins_and_fans_are_drawn(data: ot.Dataset, begun: int, tmp_path: Path, name: str):
    pytest.importorskip("matplotlib")
    path = tmp_path / name
    ot.plot(ot.whatif.counterfactual(data, begun, delay=1.0), out=path)
    assert path.stat().st_size > 5_000
    with pytest.raises(ConfigError, match="source: expected a data set"):
        ot.plot(Stage.PASS, out=path)


def test_a_fan_names_every_vehicle_of_its_scene(data: ot.Dataset, begun: int):
    """The target too, which the ego comes near to."""
    plots = pytest.importorskip("overtaking.show.plots.whatif")
    figure = plots.draw_fan(ot.whatif.outcome_fan(data, begun, futures=5, interval=5.0))
    named = [one.get_text() for one in figure.axes[0].texts]
    assert {"ego", "target"} <= set(named)
    assert len(named) == len(figure.axes[0].lines) - 1  # One says when it began.
