"""The policy under which classes are read where none is named, and the outputs that name it."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any, get_args

import pytest

import overtaking as ot
from overtaking.cli import main, options
from overtaking.data.balance import ClassBalance
from overtaking.labels.law.judging import (
    DEFAULT_POLICY,
    POLICY_OF_PROFILE,
    STORED_POLICIES,
    choose_policy,
    default_policy,
)
from overtaking.scenarios.profiles import profile_names
from overtaking.show.video import jobs
from overtaking.show.video.film import Film

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.data.load import Dataset

pytestmark = pytest.mark.ci

POLICY_OF = {"motorway": "default", "pinto2023-physical": "paper", "recording": "default"}


@pytest.fixture(scope="module", params=POLICY_OF)
def read(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Dataset, str]:
    """A data set and the policy under which it is read."""
    name, folder = request.param, tmp_path_factory.mktemp("data")
    if name != "recording":
        data = ot.generate_dataset(name, num_simulations=12, seed=3, out=folder / "data")
        return data, POLICY_OF[name]
    # The recording is of the study's profile: the format of a recording decides, not its origin.
    data = ot.generate_dataset("pinto2023-physical", num_simulations=2, seed=3, out=folder / "data")
    ot.export_dataset(data, folder / "highd", file_format="highd")
    tracks = next((folder / "highd").rglob("*_tracks.csv"))
    return ot.import_recording("highd", tracks, folder / "recording"), POLICY_OF[name]


def run_command(capsys: pytest.CaptureFixture[str], *words: Any) -> str:
    """The output of a command that succeeds."""
    assert main([str(word) for word in words]) == 0
    return capsys.readouterr().out


def test_only_profiles_of_the_study_are_read_under_paper():
    read_under_paper = {name for name in profile_names() if default_policy(name) == "paper"}
    assert read_under_paper == {"pinto2023", "pinto2023-physical"}
    assert default_policy("a profile of one's own") == "default"
    assert choose_policy(None, "pinto2023") == "paper"
    assert choose_policy("strict", "pinto2023") == "strict"


def test_default_policies_exist_and_the_help_states_them():
    names = {DEFAULT_POLICY, *POLICY_OF_PROFILE.values()}
    assert names <= {policy.name for policy in STORED_POLICIES}
    profiles = " and ".join(POLICY_OF_PROFILE)
    _, option = get_args(options.Policy)
    help_text = option.help
    assert f"[default: {DEFAULT_POLICY}; paper for {profiles}]" in help_text


def test_features_and_statistics_have_the_default_policy(
    read: tuple[Dataset, str], capsys: pytest.CaptureFixture[str]
):
    data, policy = read
    labels = data.labels()
    classes = labels.loc[labels["policy"] == policy, "class"].astype(str)
    assert data.features()["CLASS"].astype(str).tolist() == classes.tolist()
    statistics = ot.dataset_statistics(data)
    assert statistics.sample.policy == policy
    assert all(f"policy {policy}" in table.title for table in statistics.tables)
    assert json.loads(run_command(capsys, "stats", data.path, "--json"))["policy"] == policy
    assert f"classes under the policy {policy}" in run_command(capsys, "stats", data.path)


def test_report_names_the_default_policy(read: tuple[Dataset, str], tmp_path: Path):
    data, policy = read
    page = ot.write_report(data, tmp_path / "report").path.read_text()
    assert f"Classes under the policy {policy}</h2>" in page
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", page, re.DOTALL)
    assert any(f"Classes under the policy {policy}." in caption for caption in captions)


def test_films_name_the_default_policy(read: tuple[Dataset, str]):
    data, policy = read
    job = next(jobs.jobs(data, [0]))
    assert job.policy.name == policy
    film = Film(job.labelled.trajectories, label=job.label)
    assert f"policy {policy}" in film.meaning


def test_page_opens_under_the_default_policy(read: tuple[Dataset, str], tmp_path: Path):
    data, policy = read
    text = ot.write_viewer_page(data, tmp_path / "page.html", simulation_ids=[0]).path.read_text()
    payload = re.search(r'id="data">(.*?)</script>', text, re.DOTALL)
    assert payload is not None
    assert json.loads(payload[1])["policy"] == policy


def test_show_names_the_default_policy_first(
    read: tuple[Dataset, str], capsys: pytest.CaptureFixture[str]
):
    data, policy = read
    values = json.loads(run_command(capsys, "show", data.path, "0", "--json"))
    assert values["policy"] == policy
    name = values["policies"][policy]["class"]
    assert re.search(
        rf"Class +{name} under {policy}\b", run_command(capsys, "show", data.path, "0")
    )


def test_other_functions_use_the_default_policy(
    read: tuple[Dataset, str], capsys: pytest.CaptureFixture[str]
):
    data, policy = read
    assert ot.law.tolerance_curve(data.path).policy == policy
    assert json.loads(run_command(capsys, "law", "curve", data.path, "--json"))["policy"] == policy
    if data.profile in profile_names():
        assert ot.whatif.outcome_fan(data, 0, futures=1, interval=10.0).policy == policy
        twins = json.loads(run_command(capsys, "twin", data.path, "0", "--stay", "--json"))
        assert twins["policy"] == policy


@pytest.mark.parametrize(("profile", "policy"), [("motorway", "default"), ("pinto2023", "paper")])
def test_balanced_data_sets_record_the_default_policy(profile: str, policy: str, tmp_path: Path):
    balance = ClassBalance(candidates=60, allows_missing=True)
    data = ot.generate_dataset(
        profile, num_simulations=5, seed=1, out=tmp_path / "data", balance=balance
    )
    recorded = data.manifest.identity.balance
    assert recorded is not None
    assert recorded.policy == policy


@pytest.mark.parametrize(("profile", "policy"), [("motorway", "default"), ("pinto2023", "paper")])
def test_comparisons_of_simulators_have_the_default_policy(profile: str, policy: str):
    comparison = ot.compare_simulators(
        profile, num_simulations=2, seed=1, simulators=("engine", "reference")
    )
    assert comparison.policy == policy
