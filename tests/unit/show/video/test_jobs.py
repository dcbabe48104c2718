"""Which simulations become films, and that many are made beside each other."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import overtaking as ot
from overtaking.cli.film import choice
from overtaking.cli.options import Shown
from overtaking.core.errors import ConfigError
from overtaking.model.scenario import ForcedDecision
from overtaking.model.verdicts import OvertakeClass
from overtaking.show.video import jobs as module
from overtaking.show.video.jobs import jobs, num_films
from overtaking.show.video.produce import produce


@pytest.fixture(scope="module", params=["frames", "features"])
def data(request, tmp_path_factory):
    """Data sets with and without what has a row per frame."""
    folder = tmp_path_factory.mktemp("data") / request.param
    return ot.generate_dataset(
        "pinto2023-physical", num_simulations=24, seed=1, out=folder, keep=request.param
    )


def test_one_film_for_each_class_the_first_of_it(data):
    labels = data.labels()
    paper = labels[labels["policy"] == "paper"]
    firsts = paper.groupby("class", observed=True)["simulation"].min()
    expected = sorted((int(number), str(name)) for name, number in firsts.items())
    assert [(job.number, job.label.title) for job in jobs(data)] == expected


def test_a_class_is_shown_by_its_first_simulation_that_lasts_long_enough():
    batch = ot.label(ot.simulate(ot.sample("pinto2023-physical", num_simulations=24, seed=1)))
    classes = batch.labels.classes[:, 0]
    numbers = np.flatnonzero(classes == OvertakeClass.SUCCESS_I)
    trajectories = batch.trajectories
    num_frames = trajectories.num_frames.copy()
    num_frames[numbers[0]] = 3  # As simulations of recordings may be.
    shorter = trajectories.replace(num_frames=num_frames)
    (first,) = (
        job.number
        for job in jobs(dataclasses.replace(batch, trajectories=shorter))
        if job.label == OvertakeClass.SUCCESS_I
    )
    assert first == numbers[1]
    num_frames[numbers] = 3
    num_frames[numbers[-1]] = 4
    shorter = trajectories.replace(num_frames=num_frames)
    *_, last = jobs(dataclasses.replace(batch, trajectories=shorter))
    assert last.number == numbers[-1]


def test_all_of_them_in_order(data):
    assert [job.number for job in jobs(data, "all")] == list(range(24))


def test_films_are_in_order_and_each_simulation_once(data):
    films = list(jobs(data, [7, 3, 7]))
    assert [job.number for job in films] == [3, 7]
    assert films[0].labelled.trajectories.scenario.scenario_index.tolist() == [3]


def test_integers_of_numpy_choose_simulations_as_plain_ones_do(data):
    numbers_of_numpy = np.array([7, 3])
    assert num_films(data, numbers_of_numpy) == 2
    numbers = [job.number for job in jobs(data, numbers_of_numpy)]
    assert numbers == [3, 7]
    assert {type(number) for number in numbers} == {int}  # The page writes them as JSON.


@pytest.mark.parametrize("selection", [[24], [-1], [], "some"])
def test_unknown_simulations_are_refused(data, selection):
    with pytest.raises(ConfigError, match="choice: simulations: expected") as caught:
        list(jobs(data, selection))
    assert "\n" not in str(caught.value)


def test_films_are_made_beside_each_other_and_named_by_their_number(data, tmp_path):
    told: list[tuple[int, int]] = []
    short = [_shortened(job) for job in jobs(data, [2, 5, 11])]
    made = produce(short, tmp_path / "videos", threads=2, progress=lambda *both: told.append(both))
    assert [film.number for film in made] == [2, 5, 11]
    assert {path.name for path in (tmp_path / "videos").iterdir()} == {
        "000002.mp4",
        "000005.mp4",
        "000011.mp4",
    }
    assert told[-1] == (3, 3)
    assert made[0].duration == pytest.approx(0.25)


def test_a_film_that_fails_ends_the_work_and_leaves_what_was_finished(data, tmp_path):
    def failing():
        yield _shortened(next(jobs(data, [1])))
        raise ConfigError("the data set ends here")

    with pytest.raises(ConfigError, match="ends here"):
        produce(failing(), tmp_path, threads=1)
    assert {path.name for path in tmp_path.glob("*.mp4")} <= {"000001.mp4"}


def test_an_unknown_policy_is_refused(data):
    with pytest.raises(ConfigError, match="expected paper or default or strict"):
        list(jobs(data, policy_name="lenient"))


def test_numbers_and_ranges_are_read():
    assert choice(Shown(simulation_ids="1,7,20-23"), "film") == [1, 7, 20, 21, 22, 23]
    assert choice(Shown(every=True), "film") == "all"
    assert choice(Shown(), "film") == "one-per-class"


@pytest.mark.parametrize("text", ["", "a", "1,,2", "7-3", "-1", "1-", "1.5", "0-99999999999"])
def test_what_is_no_number_is_refused_in_one_line(text):
    with pytest.raises(ConfigError, match="expected numbers and ranges") as caught:
        choice(Shown(simulation_ids=text), "film")
    assert "\n" not in str(caught.value)


def test_two_choices_at_once_are_refused():
    with pytest.raises(ConfigError, match="leave out the others"):
        choice(Shown(simulation_ids="1", every=True), "film")


def _shortened(job):
    """The same job with a quarter of a second of film."""
    run = job.labelled.trajectories
    short = run.replace(num_frames=run.num_frames.clip(max=5))
    return dataclasses.replace(job, labelled=job.labelled.replace(trajectories=short))


SHORT = {"time.horizon_s": 2, "time.attempt_deadline_s": 2}


@pytest.fixture(scope="module")
def runs():
    return ot.simulate(ot.sample("pinto2023-physical", num_simulations=3, seed=1, overrides=SHORT))


def test_trajectories_are_labelled_and_filmed(runs, tmp_path):
    made = ot.film(runs, tmp_path, simulation_ids=[2, 0], policy="default")
    assert [film.path.name for film in made] == ["000000.mp4", "000002.mp4"]
    classes = ot.label(runs).labels.classes[:, 1]
    assert [film.label for film in made] == [OvertakeClass(classes[i]).title for i in (0, 2)]
    assert made[0].num_frames == 41


def test_labels_that_are_known_are_not_computed_again(runs, monkeypatch):
    labelled = ot.label(runs)
    monkeypatch.setattr(module, "label", None)
    assert [job.number for job in jobs(labelled, "all")] == [0, 1, 2]


def test_a_branch_is_filmed(runs):
    scenario = runs.scenario.select(slice(0, 1))
    (job,) = jobs(ot.branch(scenario, 10, decision=ForcedDecision.CANCEL), "all")
    assert job.number == 0


def test_a_simulation_that_is_not_in_the_batch_is_refused(runs):
    with pytest.raises(ConfigError, match="expected some of 0 to 2, got 3"):
        list(jobs(runs, [3]))
