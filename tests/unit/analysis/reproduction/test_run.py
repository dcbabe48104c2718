"""A reproduction: its replicates, its percentiles, its page and its command."""

from __future__ import annotations

import dataclasses
import json
import re
import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest

import overtaking as ot
from overtaking.analysis.reproduction import tables, words
from overtaking.analysis.reproduction.replicates import SIZE, Replicates
from overtaking.analysis.reproduction.run import Comparison, Reproduction
from overtaking.analysis.reproduction.statements import calibration, statements
from overtaking.analysis.reproduction.variants import farther, pushed
from overtaking.cli.output import page_text
from overtaking.cli.reproducing import page_parts
from overtaking.core.errors import ConfigError
from overtaking.model.verdicts import OvertakeClass
from overtaking.scenarios.profiles import load_specification

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.show.report.files import Written

pytestmark = pytest.mark.ci

SEED = 5


@pytest.fixture(scope="module")
def found() -> Reproduction:
    return ot.reproduce_study("pinto2023", num_replicates=2, seed=SEED)


def named(found: Reproduction, name: str) -> Comparison:
    return next(one for one in found.comparisons if one.name == name)


def among(values: list[float], paper: float, *, decimals: int = 2) -> Comparison:
    like = statements()["d_unsuccess_col"]
    stated = dataclasses.replace(like.stated, value=round(paper, decimals))
    one = dataclasses.replace(like, stated=stated)
    return Comparison(name="x", statement=one, replicates=np.array(values))


def test_every_number_of_the_paper_is_there(found: Reproduction):
    assert [one.name for one in found.comparisons] == list(statements())
    assert all(len(one.replicates) == (1 if one.is_design else 2) for one in found.comparisons)


def test_replicates_are_the_simulations_of_the_profile_in_order(found: Reproduction):
    for number in range(2):
        batch = ot.sample(
            "pinto2023", num_simulations=SIZE, seed=SEED, first_scenario=number * SIZE
        )
        classes = ot.label(ot.simulate(batch)).labels.classes[:, 0]
        for kind in OvertakeClass:
            name = f"count_{kind.title.lower()}"
            if name in statements():
                assert named(found, name).replicates[number] == (classes == kind).sum()


def test_a_replicate_is_the_same_whatever_follows(found: Reproduction):
    alone = ot.reproduce_study("pinto2023", num_replicates=1, seed=SEED)
    for one, other in zip(alone.comparisons, found.comparisons, strict=True):
        assert one.replicates[0] == pytest.approx(other.replicates[0], nan_ok=True)


def test_speeds_stand_in_the_unit_of_the_paper(found: Reproduction):
    batch = ot.sample("pinto2023", num_simulations=SIZE, seed=SEED)
    said = ot.label(ot.simulate(batch))
    illegal = said.labels.classes[:, 0] == OvertakeClass.SUCCESS_I
    mean = 3.6 * said.paper_features.ego_speed[illegal].astype(np.float64).mean()
    assert named(found, "se_success_i").replicates[0] == pytest.approx(mean)


def test_the_percentile_counts_those_below_and_half_of_the_equal():
    assert among([1.0, 2.0, 3.0, 4.0], 3.0).percentile == 62.5
    assert among([1.0, 2.0, 3.04, 4.0], 3.0).percentile == 62.5, "rounds to it"
    assert among([1.0, 2.0, 3.06, 4.0], 3.0).percentile == 50.0, "does not"
    assert among([1.0, 2.0], 3.0).percentile == 100.0


def test_replicates_without_a_value_do_not_count():
    one = among([np.nan, 1.0, 3.0], 2.0)
    assert (one.percentile, one.ours, one.values()["replicates"]) == (50.0, 2.0, 2)
    none = among([np.nan], 2.0)
    assert (none.is_inside, none.values()["ours"], none.values()["percentile"]) == (None,) * 3


def test_what_is_inside_lies_where_our_replicates_do():
    many = [float(one) for one in range(1000)]
    assert among(many, 500.0).is_inside
    assert not among(many, 990.0).is_inside


def test_inputs_are_compared_and_have_no_percentile(found: Reproduction):
    lanes = named(found, "design_lanes")
    assert (lanes.ours, lanes.statement.quoted) == (5.0, 5.0)
    assert lanes.values()["percentile"] is None
    assert named(found, "design_lane_width").ours == pytest.approx(3.5)
    assert named(found, "design_speed_highest").ours == pytest.approx(120.0)


def test_presets_give_the_correlations_that_they_must(found: Reproduction):
    assert named(found, "rho_wind_prec").ours == pytest.approx(1.0)
    assert named(found, "rho_fog_dn").ours == pytest.approx(0.91, abs=0.03)


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        ({"study": "another"}, "study"),
        ({"num_replicates": 0}, "num_replicates"),
        ({"num_replicates": 10**9}, "num_replicates"),
        ({"seed": int(calibration().seeds[0])}, "seed"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(arguments: dict[str, object], what: str):
    given = {"study": "pinto2023", "num_replicates": 1, **arguments}
    with pytest.raises(ConfigError, match=what) as caught:
        ot.reproduce_study(**given)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


def test_other_parameters_than_the_frozen_ones_are_said_to_be_other():
    changed = ot.reproduce_study("pinto2023", num_replicates=1, overrides={"time.horizon_s": 9.0})
    assert not changed.is_frozen
    assert any("not those that were fitted" in text for text in words.warnings(changed))


def test_starts_as_drawn_end_in_more_collisions(found: Reproduction):
    shares = {bool(one.value): one.shares["Unsuccess_col"] for one in found.starts}
    assert shares[True] > shares[False]


def test_the_score_counts_every_number_once(found: Reproduction):
    rows = tables.score(found).rows
    judged = [one for one in found.comparisons if one.is_inside is not None]
    assert rows["judged"].sum() == len(judged)
    assert rows["inside"].sum() == sum(bool(one.is_inside) for one in judged)
    assert list(rows["standing"])[:2] == ["by design", "fitted"]


def test_pushes_are_those_of_the_profile_times_their_factor(found: Reproduction):
    assert [one.value for one in found.pushes] == [0.0, 0.5, 1.0, 2.0]
    base = load_specification("pinto2023")
    assert base.weather.pushes is not None
    for factor in (0.0, 2.0):
        one = pushed(base, factor)
        assert one is not None
        assert one.weather.pushes is not None
        assert one.weather.pushes.accel_mps2 == factor * base.weather.pushes.accel_mps2
    assert pushed(load_specification("pinto2023-physical"), 1.0) is None


def test_the_collided_are_split_by_whether_they_had_pulled_out(found: Reproduction):
    every, before, after = found.collided
    assert every.simulations == before.simulations + after.simulations > 50
    for name in ("D", "SE", "SP"):
        weighted = (
            sum(one.means[name] * one.simulations for one in (before, after)) / every.simulations
        )
        assert weighted == pytest.approx(every.means[name], rel=0.02)


def test_a_paper_in_the_middle_is_nearer_than_all_and_one_far_away_is_farther_than_all():
    rng = np.random.default_rng(1)
    shape = (50, SIZE)
    stated = {
        one.feature: one.stated.number
        for one in statements().values()
        if one.outcome_class == "Unsuccess_col" and one.measure == "mean"
    }
    classes = {"paper": np.full(shape, OvertakeClass.UNSUCCESS_COL)}
    near = {name: value + rng.normal(size=shape) for name, value in stated.items()}
    middle = {name: values - values.mean() + stated[name] for name, values in near.items()}
    assert farther(Replicates(classes=classes, columns=middle)) > 0.99
    away = {name: values + 5.0 for name, values in middle.items()}
    assert farther(Replicates(classes=classes, columns=away)) == 0.0


@pytest.fixture(scope="module")
def made(found: Reproduction, tmp_path_factory: pytest.TempPathFactory) -> Written:
    return ot.write_report(found, tmp_path_factory.mktemp("reproduction"))


def test_the_page_is_whole_offline_and_holds_every_number(found: Reproduction, made: Written):
    text = made.path.read_text(encoding="utf-8")
    assert (made.remarks, len(made.figures)) == ((), 2)
    assert re.findall(r"https?://(?!www\.w3\.org)", text) == []
    assert {one.statement.about for one in found.comparisons if not one.is_design} <= set(
        re.findall(r'<td class="text">([^<]+)</td>', text.replace("&#x27;", "'"))
    )
    for name in made.figures:
        assert f'id="figure-{name}"' in text
        assert (made.path.parent / "figures" / f"{name}.png").stat().st_size > 10_000
    for name in made.tables:
        assert (made.path.parent / "tables" / f"{name}.csv").exists()


def test_the_same_numbers_make_the_same_page(found: Reproduction, made: Written, tmp_path: Path):
    again = found.write_report(tmp_path)
    assert again.path.read_bytes() == made.path.read_bytes()


def test_the_text_says_what_the_label_hides(found: Reproduction):
    text = page_text(page_parts(found))
    assert "leave one way to split them over the presets, with 0 at night" in text
    assert "assume that CARLA's presets were used unmodified" in text


def test_the_command_prints_the_same_as_json(found: Reproduction, tmp_path: Path):
    command = [sys.executable, "-m", "overtaking", "reproduce", "pinto2023", "--json"]
    more = [
        "--num-replicates",
        "2",
        "--seed",
        str(SEED),
        "--out",
        str(tmp_path / "page"),
        "--quiet",
    ]
    done = subprocess.run([*command, *more], capture_output=True, text=True, check=True)
    values = json.loads(done.stdout)
    assert done.stderr == ""
    assert values.pop("duration_s") > 0.0
    assert values.pop("missing") == []
    assert values.pop("page") == str(tmp_path / "page" / "index.html")
    assert values == json.loads(json.dumps(found.values()))


WITHOUT = """
import importlib.util as util, sys
from pathlib import Path
found = util.find_spec
util.find_spec = lambda name, *rest: None if name == "matplotlib" else found(name, *rest)
import overtaking as ot
made = ot.write_report(ot.reproduce_study("pinto2023", num_replicates=1), Path(sys.argv[1]))
print(len(made.figures), *made.remarks, sep="|")
"""


def test_without_the_extra_the_tables_are_there_and_it_says_what_to_install(tmp_path: Path):
    command = [sys.executable, "-c", WITHOUT, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    number, told = done.stdout.strip().split("|")
    assert number == "0"
    assert "pip install 'matplotlib>=" in told
    assert (tmp_path / "tables" / "numbers.csv").exists()
