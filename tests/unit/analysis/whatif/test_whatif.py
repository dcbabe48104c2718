"""Twins, outcome fans and sufficient changes equal direct simulations of the same changes."""

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
"""Decisions of the ego in a future in which it starts to overtake at frame 40."""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> ot.Dataset:
    """A few simulations in hard rain."""
    folder = tmp_path_factory.mktemp("whatif") / "data"
    return ot.generate_dataset(
        "pinto2023-physical", num_simulations=16, seed=7, out=folder, overrides=WET
    )


@pytest.fixture(scope="module")
def simulation(data: ot.Dataset) -> int:
    """The number of a simulation in which the ego pulls out later than 1 s (20 frames)."""
    pull_out_frames = [pull_out(data[number]) for number in range(len(data))]
    return next(
        number for number, frame in enumerate(pull_out_frames) if frame is not None and frame > 20
    )


def test_a_twin_without_effective_changes_has_the_same_hash(data: ot.Dataset, simulation: int):
    for arguments in ({}, {"without": ["fog"]}, {"delay": 0.0}):
        twin = ot.whatif.counterfactual(data, simulation, **arguments)
        assert twin.parting is None
        hashes = [branch.run.trace_hash for branch in twin.told]
        np.testing.assert_array_equal(*hashes)
    total = ot.whatif.counterfactual(data, simulation, without=["fog"], effect="total")
    np.testing.assert_array_equal(total.told[1].run.trace_hash, data[simulation].trace_hash)


def test_direct_and_total_effects_differ_in_the_start(data: ot.Dataset, simulation: int):
    direct = ot.whatif.counterfactual(data, simulation, without=["rain"])
    total = ot.whatif.counterfactual(data, simulation, without=["rain"], effect="total")
    assert (direct.effect, total.effect) == ("direct", "total")
    recorded_s = data[simulation].states.s[0, :, 0]
    np.testing.assert_array_equal(direct.told[1].run.states.s[0, : len(recorded_s), 0], recorded_s)
    redrawn = ot.sample(
        "pinto2023-physical", num_simulations=1, seed=7, first_scenario=simulation, overrides=WET
    )
    total_scenario = total.told[1].run.scenario
    num_slots = redrawn.num_slots
    # The total effect draws the same drivers and vehicles; only their start positions may differ.
    np.testing.assert_array_equal(
        total_scenario.vehicles.mass[:, :num_slots], redrawn.vehicles.mass
    )
    np.testing.assert_array_equal(
        total_scenario.drivers.time_gap[:, :num_slots], redrawn.drivers.time_gap
    )
    assert not total_scenario.weather.rain.any()


def test_the_parting_of_twins_is_the_first_frame_with_different_states(
    data: ot.Dataset, simulation: int
):
    twin = ot.whatif.counterfactual(data, simulation, without=["rain"], start_time=1.0)
    assert twin.parting is not None
    factual, counterfactual = (branch.run.states for branch in twin.told)
    frame = twin.parting.frame
    assert frame > 20  # The change begins at 1.0 s.
    for name in factual.__slots__:
        if name != "lights":
            assert (
                getattr(factual, name)[..., :frame] == getattr(counterfactual, name)[..., :frame]
            ).all()
    assert twin.lamps == 1.0
    counterfactual_value = getattr(counterfactual, twin.parting.quantity)[
        0, twin.parting.vehicle, frame
    ]
    factual_value = getattr(factual, twin.parting.quantity)[0, twin.parting.vehicle, frame]
    assert counterfactual_value != factual_value


def test_an_ego_cannot_both_stay_and_start_later(data: ot.Dataset, simulation: int):
    with pytest.raises(ConfigError, match="either an ego that stays in its lane or a later begin"):
        ot.whatif.counterfactual(data, simulation, stay=True, delay=1.0)


@pytest.mark.parametrize("delay", [0.3, 1.0, 2.5])
def test_an_ego_delayed_by_some_seconds_pulls_out_that_much_later(
    data: ot.Dataset, simulation: int, delay: float
):
    run = ot.whatif.counterfactual(data, simulation, delay=delay).told[1].run
    factual_frame, delayed_frame = pull_out(data[simulation]), pull_out(run)
    assert factual_frame is not None
    assert delayed_frame is not None
    assert delayed_frame - factual_frame - round(delay * 20) in (0, 1)


def test_an_ego_that_stays_never_pulls_out(data: ot.Dataset, simulation: int):
    assert pull_out(ot.whatif.counterfactual(data, simulation, stay=True).told[1].run) is None


def test_a_careful_driver_has_the_traits_of_a_careful_driving_style(
    data: ot.Dataset, simulation: int
):
    twin = ot.whatif.counterfactual(data, simulation, driving_style="careful")
    origin = twin.told[1].run.branch_origin
    assert origin is not None
    (intervention,) = origin.interventions
    careful = WET | {"drivers.driving_style": [0.0, 0.0]}
    drivers = ot.sample(
        "pinto2023-physical",
        num_simulations=1,
        seed=7,
        first_scenario=simulation,
        overrides=careful,
    ).drivers
    assert set(intervention.traits) == set(drivers.__slots__)
    for name, value in intervention.traits.items():
        assert value == getattr(drivers, name)[0, 0]


def test_changes_that_cannot_be_drawn_again_have_no_total_effect(data: ot.Dataset, simulation: int):
    for arguments in ({"stay": True}, {"delay": 1.0}, {"without": ["rain"], "start_time": 1.0}):
        with pytest.raises(ConfigError, match="total effect"):
            ot.whatif.counterfactual(data, simulation, effect="total", **arguments)
    with pytest.raises(ConfigError, match=r"driving_style: expected .*careful"):
        ot.whatif.counterfactual(data, simulation, driving_style="brave")


@pytest.mark.parametrize("effect", ["direct", "total"])
def test_saved_twins_can_be_simulated_again_from_their_manifest(
    data: ot.Dataset, simulation: int, tmp_path: Path, effect: str
):
    twin = ot.whatif.counterfactual(data, simulation, without=["rain"], effect=effect)
    saved = ot.whatif.save_branches(data, twin, tmp_path / "twin")
    for number, branch in enumerate(twin.told):
        resimulated = ot.whatif.resimulate_branch(saved, number)
        np.testing.assert_array_equal(resimulated.trace_hash, branch.run.trace_hash)
        np.testing.assert_array_equal(saved[number].trace_hash, branch.run.trace_hash)
    table = saved.labels()
    paper_classes = table[table["policy"] == "paper"]["class"]
    assert list(paper_classes) == [class_of(labelled, "paper") for labelled in twin.labelled]
    assert "| 1 |" in (saved.path / "README.md").read_text()
    with pytest.raises(ot.OvertakingError, match="which are written whole"):
        ot.resume_dataset(saved.path)


def test_a_branch_of_a_saved_branch_keeps_its_changes(
    data: ot.Dataset, simulation: int, tmp_path: Path
):
    dry = ot.whatif.counterfactual(data, simulation, without=["rain"])
    saved = ot.whatif.save_branches(data, dry, tmp_path / "twin")
    dry_then_stay = ot.whatif.counterfactual(saved, 1, stay=True)
    dry_and_stay = ot.whatif.counterfactual(data, simulation, without=["rain"], stay=True)
    np.testing.assert_array_equal(
        dry_then_stay.told[1].run.trace_hash, dry_and_stay.told[1].run.trace_hash
    )


def test_a_removed_vehicle_has_no_states_after_its_removal(
    data: ot.Dataset, simulation: int, tmp_path: Path
):
    branch = ot.branch(
        data[simulation], interventions=[ot.Intervention(frame=30, slot=1, remove=True)]
    )
    saved = ot.whatif.save_branches(data, {"without vehicle 1": branch}, tmp_path / "gone")
    states = saved.states(0)
    assert (states[states["vehicle"] == 1]["frame"] < 30).all()
    np.testing.assert_array_equal(saved[0].state_mask, branch.state_mask)
    np.testing.assert_array_equal(saved[0].states.s, branch.states.s)


def test_the_first_future_has_the_random_numbers_of_the_simulation(
    data: ot.Dataset, simulation: int
):
    scene = scene_of(data, simulation)
    futures = started(scene.world, 40, copies(scene.world, 40, 8))
    branch = ot.branch(scene.scenario, interventions=STARTS)
    np.testing.assert_array_equal(futures.trace_hash[:1], branch.trace_hash)
    assert len(np.unique(futures.trace_hash, axis=0)) == 8
    for name in futures.states.__slots__:
        values = getattr(futures.states, name)[:, :, :41]
        np.testing.assert_array_equal(values, np.broadcast_to(values[:1], values.shape))


def test_futures_of_a_branch_contain_its_changes(data: ot.Dataset, simulation: int, tmp_path: Path):
    """Changes before, at and after the start count; the branch's own decision does not."""
    changes = [
        ot.Intervention(without=("rain",)),
        ot.Intervention(frame=30, slot=2, position_change=15.0, speed_change=-3.0),
        ot.Intervention(frame=40, slot=1, traits={"time_gap": 2.5}),
        ot.Intervention(frame=60, slot=3, remove=True),
    ]
    changed = ot.branch(
        data[simulation],
        interventions=[*changes, ot.Intervention(frame=25, decision=STARTS[1].decision)],
    )
    saved = ot.whatif.save_branches(data, {"much changed": changed}, tmp_path / "much")
    scene = scene_of(saved, 0)
    futures = started(scene.world, 40, copies(scene.world, 40, 3))
    branch = ot.branch(data[simulation], interventions=[*changes, *STARTS])
    np.testing.assert_array_equal(futures.trace_hash[:1], branch.trace_hash)
    np.testing.assert_array_equal(
        ot.label(futures).findings.margin[:1], ot.label(branch).findings.margin
    )
    assert not futures.state_mask[:, 3, 60:].any()
    assert futures.scenario.weather.rain[0] == 0.0


def test_a_fan_of_a_branch_shows_the_changed_world(
    data: ot.Dataset, simulation: int, tmp_path: Path
):
    dry = ot.branch(data[simulation], interventions=[ot.Intervention(without=("rain",))])
    stays = ot.branch(data[simulation], decision=ot.ForcedDecision.STAY)
    saved = ot.whatif.save_branches(data, {"dry": dry, "stays": stays}, tmp_path / "two")
    factual_fan, dry_fan, staying_fan = (
        ot.whatif.outcome_fan(dataset, number, futures=30, interval=2.0)
        for dataset, number in ((data, simulation), (saved, 0), (saved, 1))
    )
    assert staying_fan.actual is None
    np.testing.assert_array_equal(staying_fan.counts, factual_fan.counts)
    assert not np.array_equal(dry_fan.counts, factual_fan.counts)
    assert not dry_fan.stayed.scenario.weather.rain.any()


def test_worlds_that_the_ego_believes_contain_the_changes_of_the_branch(
    data: ot.Dataset, simulation: int, tmp_path: Path
):
    """A removed vehicle is absent; a driver with a changed time gap keeps it in every world."""
    changes = [
        ot.Intervention(frame=5, slot=3, remove=True),
        ot.Intervention(frame=10, slot=2, traits={"time_gap": 2.5}),
    ]
    saved = ot.whatif.save_branches(
        data, {"one": ot.branch(data[simulation], interventions=changes)}, tmp_path / "one"
    )
    scene = scene_of(saved, 0)
    stayed = scene.branch(ot.Intervention(decision=ot.ForcedDecision.STAY))
    percept = Percept.of(started(scene.world, 20, copies(scene.world, 20, 1)))
    assert percept is not None
    assert 3 not in percept.vehicle[percept.detected]
    worlds = proposals(scene, stayed, 20, percept, 200)
    assert (worlds.scenario.start_s[:, 3] < -10_000.0).all()
    time_gap = worlds.scenario.drivers.time_gap
    assert (time_gap[:, 2] == 2.5).all()
    assert len(np.unique(time_gap[:, 1])) > TOO_FEW
    assert percept.is_shared_by(started(scene.world, 20, worlds)).sum() > TOO_FEW


def test_a_fan_counts_the_classes_of_its_futures(data: ot.Dataset, simulation: int):
    fan = ot.whatif.outcome_fan(data, simulation, futures=30, interval=2.0)
    assert (fan.futures == 30).all()
    scene = scene_of(data, simulation)
    frame = round(float(fan.time[1]) * 20)
    labels = ot.label(started(scene.world, frame, copies(scene.world, frame, 30))).labels
    for outcome_class in OvertakeClass:
        assert fan.counts[1, outcome_class] == (labels.classes[:, 0] == outcome_class).sum()
        wilson = binomtest(int(fan.counts[1, outcome_class]), 30).proportion_ci(method="wilson")
        np.testing.assert_allclose(
            fan.interval(outcome_class)[1], (wilson.low, wilson.high), atol=1e-6
        )
    small_fan = ot.whatif.outcome_fan(data, simulation, futures=TOO_FEW - 1, interval=5.0)
    assert np.isnan(small_fan.shares).all()


def test_worlds_that_the_ego_believes_differ_only_in_unperceived_quantities(
    data: ot.Dataset, simulation: int
):
    scene = scene_of(data, simulation)
    stayed = scene.branch(ot.Intervention(decision=ot.ForcedDecision.STAY))
    percept = Percept.of(started(scene.world, 20, copies(scene.world, 20, 1)))
    assert percept is not None
    worlds = proposals(scene, stayed, 20, percept, 200)
    run = started(scene.world, 20, worlds)
    consistent = run.select(percept.is_shared_by(run))
    assert consistent.scenario.num_simulations > TOO_FEW
    for role, is_detected in enumerate(percept.detected):
        np.testing.assert_array_equal(consistent.percepts.is_detected[:, 0, role], is_detected)
    drivers = consistent.scenario.drivers
    assert (drivers.time_gap[:, 0] == drivers.time_gap[0, 0]).all()
    assert len(np.unique(drivers.time_gap[:, 1])) > TOO_FEW
    # The true gap varies by the ego's error of judgement around the gap that the ego believes.
    true_gap = consistent.percepts.true_gap[:, 0, PerceivedVehicle.LEADER] * 1e-3
    if percept.detected[0]:
        assert np.std(true_gap) > 0.1
        believed_gap = percept.gap[PerceivedVehicle.LEADER]
        mean_gap = np.mean(consistent.percepts.gap[:, 0, PerceivedVehicle.LEADER] * 1e-3)
        assert abs(mean_gap - believed_gap) < 0.1 * believed_gap


@pytest.mark.parametrize("frame", [0, 1])
def test_the_ego_of_a_proposed_world_makes_the_error_that_the_proposal_assumes(
    data: ot.Dataset, frame: int
):
    # A proposal places a detected leader so that the ego believes the gap of the percept. A spread
    # below 5 % shows it: the ego's judgement of distances has a standard error of some 15 %.
    scene = scene_of(data, 0)
    stayed = scene.branch(ot.Intervention(decision=ot.ForcedDecision.STAY))
    percept = Percept.of(started(scene.world, frame, copies(scene.world, frame, 1)))
    assert percept is not None
    assert percept.detected[PerceivedVehicle.LEADER]
    run = started(scene.world, frame, proposals(scene, stayed, frame, percept, 200))
    believed_gap = run.percepts.gap[:, 0, PerceivedVehicle.LEADER] * 1e-3
    assert np.std(believed_gap / percept.gap[PerceivedVehicle.LEADER]) < 0.05


def test_a_simulation_confirms_every_sufficient_change_of_the_time_gap(data: ot.Dataset):
    table = data.labels()
    paper_labels = table[table["policy"] == "paper"]
    illegal_simulations = paper_labels[paper_labels["class"] == "Success_I"]["simulation"].tolist()
    num_sufficient = 0
    for number in illegal_simulations[:3]:
        result = ot.whatif.sufficient_changes(data, number)
        assert result.was == "Success_I"
        for change in result.found:
            if change.least is None or not change.name.startswith("ego: time gap wanted"):
                continue
            scenario = data.scenario(number)
            time_gap = float(scenario.drivers.time_gap[0, 0]) + change.least
            run = ot.branch(
                scenario, interventions=[ot.Intervention(traits={"time_gap": time_gap})]
            )
            assert class_of(ot.label(run), "paper") == change.becomes == "Success_L"
        num_sufficient += sum(change.least is not None for change in result.found)
        assert all(math.isnan(change.larger) or 0 <= change.larger <= 1 for change in result.found)
    assert num_sufficient


def test_a_driver_who_estimates_the_passing_time_well_avoids_the_head_on_collision(
    data: ot.Dataset,
):
    golden_scenes = json.loads((GOLDEN / "trace_hashes.json").read_text(encoding="utf-8"))
    golden = next(scene for scene in golden_scenes if scene["name"] == "rural-head-on-collision")
    drawn = ot.sample(
        "rural",
        num_simulations=1,
        seed=golden["seed"],
        first_scenario=golden["index"],
        overrides=golden["overrides"],
    )
    scene = Scene(data=data, number=0, run=ot.simulate(drawn))
    changes = {change.name: change for change in enough_of(scene, goal="safe").found}
    least = changes["ego: time believed for a pass, over what it takes"].least
    assert least is not None
    assert least > 0.0
    passing_time_factor = float(drawn.drivers.passing_time_factor[0, 0]) + least
    run = ot.branch(
        drawn, interventions=[ot.Intervention(traits={"passing_time_factor": passing_time_factor})]
    )
    assert class_of(ot.label(run), "paper") not in [kind.title for kind in ACCIDENTS]


def test_a_goal_that_the_simulation_reached_already_is_refused(data: ot.Dataset, simulation: int):
    table = data.labels()
    paper_classes = table[table["policy"] == "paper"].set_index("simulation")["class"]
    safe_simulation = next(
        number
        for number, class_name in paper_classes.items()
        if class_name not in [accident.title for accident in ACCIDENTS]
    )
    with pytest.raises(ConfigError, match="expected one that was not safe"):
        ot.whatif.sufficient_changes(data, int(safe_simulation), goal="safe")


def test_simulations_of_an_external_driver_have_no_twin(tmp_path: Path):
    def coasting_driver(observation: ot.Observation) -> np.ndarray:
        return np.zeros((len(observation.is_running), 2))

    driver = ot.Driver(function=coasting_driver, observation="truth")
    data = ot.generate_dataset(
        "pinto2023-physical", num_simulations=1, seed=1, out=tmp_path / "driven", driver=driver
    )
    with pytest.raises(ConfigError, match="expected simulations of this package's drivers"):
        ot.whatif.counterfactual(data, 0, stay=True)


def test_a_film_of_twins_shows_one_above_the_other(
    data: ot.Dataset, simulation: int, tmp_path: Path
):
    av = pytest.importorskip("av")
    twin = ot.whatif.counterfactual(data, simulation, delay=1.0)
    path = ot.film(twin, tmp_path / "twin.mp4")
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        longest_frames = max(int(branch.run.num_frames[0]) for branch in twin.told)
        assert (stream.width, stream.height, stream.frames) == (1280, 832, longest_frames)
        first_frame = next(film.decode(video=0)).to_ndarray(format="rgb24").astype(int)
    # Before the twins part both halves show the same road.
    assert np.abs(first_frame[60:270] - first_frame[492:702]).mean() < 2.0


def test_both_halves_of_a_film_of_twins_have_the_same_time_axis(data: ot.Dataset, simulation: int):
    twin = ot.whatif.counterfactual(data, simulation, stay=True)
    num_frames = [int(branch.run.num_frames[0]) for branch in twin.told]
    assert min(num_frames) < max(num_frames)
    picture = TwinFilm(twin).draw(min(num_frames) - 1).to_rgb().astype(int)
    # The cursor is the column that is bright in every row of the curves.
    strips = [picture[top + SCENE_BOTTOM + 12 : top + SCENE_BOTTOM + 90] for top in (0, 432)]
    cursor_above, cursor_below = [int(strip.sum(axis=2).min(axis=0).argmax()) for strip in strips]
    assert cursor_above == cursor_below


@pytest.mark.parametrize("name", ["twin.svg", "twin.pdf", "twin.png"])
def test_a_twin_is_drawn_and_an_unplottable_source_is_refused(
    data: ot.Dataset, simulation: int, tmp_path: Path, name: str
):
    pytest.importorskip("matplotlib")
    path = tmp_path / name
    ot.plot(ot.whatif.counterfactual(data, simulation, delay=1.0), out=path)
    assert path.stat().st_size > 5_000
    with pytest.raises(ConfigError, match="source: expected a data set"):
        ot.plot(Stage.PASS, out=path)


def test_a_fan_names_every_vehicle_of_its_scene(data: ot.Dataset, simulation: int):
    """The target has a name although the ego comes near to it."""
    plots = pytest.importorskip("overtaking.show.plots.whatif")
    figure = plots.draw_fan(ot.whatif.outcome_fan(data, simulation, futures=5, interval=5.0))
    labels = [text.get_text() for text in figure.axes[0].texts]
    assert {"ego", "target"} <= set(labels)
    assert len(labels) == len(figure.axes[0].lines) - 1  # One text says when the overtake began.
