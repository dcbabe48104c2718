"""The reproduction of Pinto (2023): replicates, percentiles, page and command."""

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
def reproduction() -> Reproduction:
    return ot.reproduce_study("pinto2023", num_replicates=2, seed=SEED)


def comparison_of(reproduction: Reproduction, name: str) -> Comparison:
    return next(comparison for comparison in reproduction.comparisons if comparison.name == name)


def comparison_with(
    replicates: list[float], paper_value: float, *, decimals: int = 2
) -> Comparison:
    """A comparison of replicates with a paper's value that is printed to some decimals."""
    template = statements()["d_unsuccess_col"]
    stated = dataclasses.replace(template.stated, value=round(paper_value, decimals))
    statement = dataclasses.replace(template, stated=stated)
    return Comparison(name="x", statement=statement, replicates=np.array(replicates))


def test_a_reproduction_compares_every_number_of_the_paper(reproduction: Reproduction):
    assert [comparison.name for comparison in reproduction.comparisons] == list(statements())
    assert all(
        len(comparison.replicates) == (1 if comparison.is_design else 2)
        for comparison in reproduction.comparisons
    )


def test_replicates_are_the_simulations_of_the_profile_in_order(reproduction: Reproduction):
    for replicate in range(2):
        batch = ot.sample(
            "pinto2023", num_simulations=SIZE, seed=SEED, first_scenario=replicate * SIZE
        )
        classes = ot.label(ot.simulate(batch)).labels.classes[:, 0]
        for outcome_class in OvertakeClass:
            name = f"count_{outcome_class.title.lower()}"
            if name in statements():
                assert (
                    comparison_of(reproduction, name).replicates[replicate]
                    == (classes == outcome_class).sum()
                )


def test_a_replicate_does_not_depend_on_later_replicates(reproduction: Reproduction):
    first_only = ot.reproduce_study("pinto2023", num_replicates=1, seed=SEED)
    for comparison, expected in zip(first_only.comparisons, reproduction.comparisons, strict=True):
        assert comparison.replicates[0] == pytest.approx(expected.replicates[0], nan_ok=True)


def test_ego_speeds_are_in_kilometres_per_hour_as_in_the_paper(reproduction: Reproduction):
    batch = ot.sample("pinto2023", num_simulations=SIZE, seed=SEED)
    labelled = ot.label(ot.simulate(batch))
    is_illegal = labelled.labels.classes[:, 0] == OvertakeClass.SUCCESS_I
    mean_kmh = 3.6 * labelled.paper_features.ego_speed[is_illegal].astype(np.float64).mean()
    assert comparison_of(reproduction, "se_success_i").replicates[0] == pytest.approx(mean_kmh)


def test_the_percentile_counts_smaller_replicates_and_half_of_the_equal_ones():
    assert comparison_with([1.0, 2.0, 3.0, 4.0], 3.0).percentile == 62.5
    assert comparison_with([1.0, 2.0, 3.04, 4.0], 3.0).percentile == 62.5, (
        "3.04 rounds to 3.0, which equals"
    )
    assert comparison_with([1.0, 2.0, 3.06, 4.0], 3.0).percentile == 50.0, (
        "3.06 rounds to 3.1, which is larger"
    )
    assert comparison_with([1.0, 2.0], 3.0).percentile == 100.0


def test_replicates_without_a_value_do_not_count():
    comparison = comparison_with([np.nan, 1.0, 3.0], 2.0)
    assert (comparison.percentile, comparison.ours, comparison.values()["replicates"]) == (
        50.0,
        2.0,
        2,
    )
    empty = comparison_with([np.nan], 2.0)
    assert (empty.is_inside, empty.values()["ours"], empty.values()["percentile"]) == (None,) * 3


def test_a_paper_value_is_inside_among_the_middle_replicates_only():
    replicates = [float(value) for value in range(1000)]
    assert comparison_with(replicates, 500.0).is_inside
    assert not comparison_with(replicates, 990.0).is_inside


def test_inputs_of_the_design_are_compared_without_a_percentile(reproduction: Reproduction):
    lanes = comparison_of(reproduction, "design_lanes")
    assert (lanes.ours, lanes.statement.quoted) == (5.0, 5.0)
    assert lanes.values()["percentile"] is None
    assert comparison_of(reproduction, "design_lane_width").ours == pytest.approx(3.5)
    assert comparison_of(reproduction, "design_speed_highest").ours == pytest.approx(120.0)


def test_weather_presets_reproduce_their_correlations(reproduction: Reproduction):
    assert comparison_of(reproduction, "rho_wind_prec").ours == pytest.approx(1.0)
    # The paper prints 0.91: night presets have 60 % fog or more, day presets 7 % or less.
    assert comparison_of(reproduction, "rho_fog_dn").ours == pytest.approx(0.91, abs=0.03)


@pytest.mark.parametrize(
    ("arguments", "argument_name"),
    [
        ({"study": "another"}, "study"),
        ({"num_replicates": 0}, "num_replicates"),
        ({"num_replicates": 10**9}, "num_replicates"),
        ({"seed": int(calibration().seeds[0])}, "seed"),
    ],
)
def test_an_impossible_argument_is_refused_in_one_line(
    arguments: dict[str, object], argument_name: str
):
    all_arguments = {"study": "pinto2023", "num_replicates": 1, **arguments}
    with pytest.raises(ConfigError, match=argument_name) as caught:
        ot.reproduce_study(**all_arguments)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


def test_a_reproduction_with_changed_parameters_warns_that_they_are_not_the_fitted_ones():
    changed = ot.reproduce_study("pinto2023", num_replicates=1, overrides={"time.horizon_s": 9.0})
    assert not changed.is_frozen
    assert any("not those that were fitted" in text for text in words.warnings(changed))


def test_starts_that_allow_doomed_scenes_end_in_more_collisions(reproduction: Reproduction):
    collision_shares = {
        bool(start.value): start.shares["Unsuccess_col"] for start in reproduction.starts
    }
    assert collision_shares[True] > collision_shares[False]


def test_the_score_counts_every_comparison_once(reproduction: Reproduction):
    rows = tables.score(reproduction).rows
    judged = [
        comparison for comparison in reproduction.comparisons if comparison.is_inside is not None
    ]
    assert rows["judged"].sum() == len(judged)
    assert rows["inside"].sum() == sum(bool(comparison.is_inside) for comparison in judged)
    assert list(rows["standing"])[:2] == ["by design", "fitted"]


def test_wind_pushes_scale_with_their_factor(reproduction: Reproduction):
    assert [push.value for push in reproduction.pushes] == [0.0, 0.5, 1.0, 2.0]
    specification = load_specification("pinto2023")
    assert specification.weather.pushes is not None
    for factor in (0.0, 2.0):
        push = pushed(specification, factor)
        assert push is not None
        assert push.weather.pushes is not None
        assert push.weather.pushes.accel_mps2 == factor * specification.weather.pushes.accel_mps2
    assert pushed(load_specification("pinto2023-physical"), 1.0) is None


def test_collided_egos_are_split_by_collision_before_and_after_pulling_out(
    reproduction: Reproduction,
):
    all_collided, before_pull_out, after_pull_out = reproduction.collided
    assert all_collided.simulations == before_pull_out.simulations + after_pull_out.simulations > 50
    for name in ("D", "SE", "SP"):
        weighted = (
            sum(
                group.means[name] * group.simulations for group in (before_pull_out, after_pull_out)
            )
            / all_collided.simulations
        )
        assert weighted == pytest.approx(all_collided.means[name], rel=0.02)


def test_the_share_of_farther_replicates_is_one_at_the_centre_and_zero_far_away():
    rng = np.random.default_rng(1)
    shape = (50, SIZE)
    paper_means = {
        statement.feature: statement.stated.number
        for statement in statements().values()
        if statement.outcome_class == "Unsuccess_col" and statement.measure == "mean"
    }
    classes = {"paper": np.full(shape, OvertakeClass.UNSUCCESS_COL)}
    noisy = {name: mean + rng.normal(size=shape) for name, mean in paper_means.items()}
    centred = {name: values - values.mean() + paper_means[name] for name, values in noisy.items()}
    assert farther(Replicates(classes=classes, columns=centred)) > 0.99
    shifted = {name: values + 5.0 for name, values in centred.items()}
    assert farther(Replicates(classes=classes, columns=shifted)) == 0.0


@pytest.fixture(scope="module")
def page(reproduction: Reproduction, tmp_path_factory: pytest.TempPathFactory) -> Written:
    return ot.write_report(reproduction, tmp_path_factory.mktemp("reproduction"))


def test_the_page_loads_nothing_from_the_network_and_holds_every_number(
    reproduction: Reproduction, page: Written
):
    text = page.path.read_text(encoding="utf-8")
    assert (page.remarks, len(page.figures)) == ((), 2)
    assert re.findall(r"https?://(?!www\.w3\.org)", text) == []
    assert {
        comparison.statement.about
        for comparison in reproduction.comparisons
        if not comparison.is_design
    } <= set(re.findall(r'<td class="text">([^<]+)</td>', text.replace("&#x27;", "'")))
    for name in page.figures:
        assert f'id="figure-{name}"' in text
        assert (page.path.parent / "figures" / f"{name}.png").stat().st_size > 10_000
    for name in page.tables:
        assert (page.path.parent / "tables" / f"{name}.csv").exists()


def test_the_same_numbers_make_the_same_page(
    reproduction: Reproduction, page: Written, tmp_path: Path
):
    rewritten = reproduction.write_report(tmp_path)
    assert rewritten.path.read_bytes() == page.path.read_bytes()


def test_the_page_text_states_the_assumption_behind_the_lighting_split(reproduction: Reproduction):
    text = page_text(page_parts(reproduction))
    assert "leave one way to split them over the presets, with 0 at night" in text
    assert "assume that CARLA's presets were used unmodified" in text


def test_the_command_prints_the_numbers_of_the_reproduction_as_json(
    reproduction: Reproduction, tmp_path: Path
):
    command = [sys.executable, "-m", "overtaking", "reproduce", "pinto2023", "--json"]
    options = [
        "--num-replicates",
        "2",
        "--seed",
        str(SEED),
        "--out",
        str(tmp_path / "page"),
        "--quiet",
    ]
    process = subprocess.run([*command, *options], capture_output=True, text=True, check=True)
    printed = json.loads(process.stdout)
    assert process.stderr == ""
    assert printed.pop("duration_s") > 0.0
    assert printed.pop("missing") == []
    assert printed.pop("page") == str(tmp_path / "page" / "index.html")
    assert printed == json.loads(json.dumps(reproduction.values()))


WITHOUT_MATPLOTLIB = """
import importlib.util as util, sys
from pathlib import Path
find_spec = util.find_spec
util.find_spec = lambda name, *args: None if name == "matplotlib" else find_spec(name, *args)
import overtaking as ot
page = ot.write_report(ot.reproduce_study("pinto2023", num_replicates=1), Path(sys.argv[1]))
print(len(page.figures), *page.remarks, sep="|")
"""


def test_without_matplotlib_the_page_has_tables_and_names_the_package_to_install(tmp_path: Path):
    command = [sys.executable, "-c", WITHOUT_MATPLOTLIB, str(tmp_path)]
    process = subprocess.run(command, capture_output=True, text=True, check=True)
    num_figures, remark = process.stdout.strip().split("|")
    assert num_figures == "0"
    assert "pip install 'matplotlib>=" in remark
    assert (tmp_path / "tables" / "numbers.csv").exists()
