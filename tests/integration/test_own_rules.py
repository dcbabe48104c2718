"""A pack of rules of one's own, exactly as the page that tells how to write one."""

from __future__ import annotations

import dataclasses
import json
import re
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.support.overtakes import alone, limited

import overtaking as ot
from overtaking.cli import main
from overtaking.core.errors import ConfigError
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.known_roads import known_road
from overtaking.model.verdicts import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@pytest.fixture
def page(
    repository: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[tuple[str, str]]:
    """The pack and its test, in the working folder."""
    text = (repository / "docs" / "how-to" / "write-a-rule.md").read_text(encoding="utf-8")
    pack, _, test, *_ = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    (tmp_path / "two_rules.py").write_text(pack, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield pack, test
    sys.modules.pop("two_rules", None)


def test_the_pack_of_the_page_is_short_and_passes_its_own_test(page):
    pack, test = page
    assert len(pack.splitlines()) < 70
    names: dict[str, object] = {}
    exec(compile(test, "test", "exec"), names)
    names["test_two_seconds"]()  # pyright: ignore[reportCallIssue]


@pytest.mark.ci
def test_a_pack_judges_simulations_and_data_sets_alike_and_writes_nothing(page, tmp_path, capsys):
    data = ot.generate_dataset("pinto2023", num_simulations=30, seed=1, out=tmp_path / "data")
    before = data.content_hash
    line = ["label", str(data.path), "--law", "two_rules:PACK", "--json"]
    assert main(line) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["rule_set"] == "two-1"
    assert told["simulations"] == 30
    said = ot.label(
        ot.simulate(ot.sample("pinto2023", num_simulations=30, seed=1)), law="two_rules:PACK"
    )
    assert said.findings.rule_codes == ("G1", "G2")
    for place, rule in enumerate(said.findings.rule_codes):
        for verdict in (Verdict.LEGAL, Verdict.ILLEGAL, Verdict.UNDECIDABLE):
            count = int((said.findings.verdict[:, place] == verdict).sum())
            assert told["rules"][rule][verdict.name.lower()] == count
    assert sum(told["rules"]["G1"].values()) > 0
    assert said.labels.policies == ("all",)
    assert set(told["classes"]) == {"all"}
    assert ot.load_dataset(data.path).content_hash == before
    assert main([*line[:-1]]) == 0
    assert "two-1" in capsys.readouterr().out


def test_a_pack_has_errors_of_its_own(page):
    run = ot.simulate(ot.sample("pinto2023", num_simulations=30, seed=1))
    exact = ot.label(run, law="two_rules:PACK").findings
    doubtful = ot.label(
        run, law="two_rules:PACK", errors=ot.MeasurementErrors(speed_std=1.0)
    ).findings
    near = (np.abs(exact.margin[:, 1]) < 2.0) & (exact.verdict[:, 1] != Verdict.NOT_APPLICABLE)
    assert near.any()
    assert np.array_equal(doubtful.verdict[:, 1] == Verdict.UNDECIDABLE, near)
    assert np.array_equal(doubtful.verdict[:, 0], exact.verdict[:, 0])


def test_the_portuguese_pack_is_the_one_without_a_law():
    run = ot.simulate(ot.sample("pinto2023", num_simulations=5, seed=1))
    one, two = ot.label(run), ot.label(run, law="pt")
    assert one.findings.version == two.findings.version == PORTUGAL.version
    assert np.array_equal(one.labels.classes, two.labels.classes)
    assert one.labels.policies == two.labels.policies


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ("two_rules", "expected pt, de, or MODULE:NAME"),
        ("no_such_module:PACK", "a module that can be imported"),
        ("two_rules:NOTHING", "a Pack called NOTHING, got NoneType"),
        ("two_rules:GAP", "got Rule"),
        ("broken:PACK", "ZeroDivisionError"),
    ],
)
def test_a_wrong_law_costs_one_line(page, tmp_path, law, message):
    del page
    (tmp_path / "broken.py").write_text("1 / 0\n", encoding="utf-8")
    with pytest.raises(ConfigError, match=message) as caught:
        ot.law.load_pack(law)
    assert "\n" not in str(caught.value)


def test_two_rules_of_one_code_are_no_pack():
    pack = ot.law.Pack(name="twice", version="1", rules=(PORTUGAL.rules[0],) * 2)
    with pytest.raises(ConfigError, match="a code of its own"):
        ot.law.load_pack(pack)


def test_a_speed_limit_of_another_country_counts_where_less_is_posted():
    limit = ot.law.quantity(130.0, "km/h", why="A test")
    limits = ot.law.ClassSpeedLimits(light=limit, van=limit, heavy=limit)
    general_limits = ot.law.GeneralSpeedLimits(motorway=limits, other=limits, town=limits)

    class SpeedLimit(ot.law.Criterion):
        def predicate(self) -> str:
            return f"At every frame: speed <= the posted limit and {general_limits}."

        def check(self, case: ot.law.Case) -> ot.law.Finding:
            return ot.law.keeps_limit(case, ot.law.speed_limit_bounds(case, general_limits))

    rule = dataclasses.replace(
        PORTUGAL.rule("L12"), code="G1", criterion=SpeedLimit(unit="m/s"), tolerances={}
    )
    pack = ot.law.Pack(name="mine", version="1", rules=(rule,))

    def margin(**given: Any) -> float:
        return float(ot.label(alone(**given).trajectories, law=pack).findings.margin[0, 0])

    assert margin(road=known_road("motorway")) == pytest.approx(120 / 3.6 - 30.0, abs=1e-3)
    faster = dataclasses.replace(known_road("motorway"), speed_limit=50.0)
    assert margin(road=faster) == pytest.approx(130 / 3.6 - 30.0, abs=1e-3)
    assert margin(road=limited((150.0, 200.0, 60.0))) == pytest.approx(60 / 3.6 - 30.0, abs=1e-3)
