"""Questions in SQL: answered as pandas answers them, and unable to do anything else."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest

import overtaking
import overtaking as ot
from overtaking.analysis.database.entities import Relation, relations
from overtaking.cli import main
from overtaking.core.errors import ConfigError, DatasetError

if TYPE_CHECKING:
    from overtaking import Dataset

pytestmark = pytest.mark.ci

SIMULATIONS = 24
SHARDS = 3


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set whose name is an attempt of its own."""
    path = tmp_path_factory.mktemp("data") / "it's; DROP TABLE labels --"
    ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=SIMULATIONS,
        seed=5,
        out=path,
        shard_size=SIMULATIONS // SHARDS,
    )
    return path


@pytest.fixture(scope="module")
def data(folder: Path) -> Dataset:
    return overtaking.load_dataset(folder)


@pytest.fixture(scope="module")
def states(data: Dataset) -> pd.DataFrame:
    """The states of all simulations, read one by one."""
    parts = [data.states(number) for number in range(len(data))]
    return pd.concat(parts, ignore_index=True)


def ask(data: Dataset, sql: str, **bounds: Any) -> list[tuple[Any, ...]]:
    return ot.sql(data, sql, **bounds).rows


# --- answers, from easy to hard ---


def test_a_count_is_that_of_pandas(data: Dataset):
    found = ask(data, "select class, count(*) from labels where policy = 'paper' group by 1")
    labels = data.labels()
    expected = labels[labels["policy"] == "paper"]["class"].value_counts()
    assert dict(found) == {name: count for name, count in expected.items() if count}


def test_the_papers_weather_is_that_of_its_presets(data: Dataset):
    found = ask(data, "select DN, HL, count(*) from paper.Weather group by all order by all")
    weather = data.weather()
    words = weather.assign(
        DN=weather["night"].map({True: "Night", False: "Day"}),
        HL=weather["low_sun"].map({True: "Yes", False: "No"}),
    )
    counts = words.groupby(["DN", "HL"]).size()
    assert found == [(*names, count) for names, count in zip(counts.index, counts, strict=True)]


def test_a_join_of_the_papers_entities_is_that_of_pandas(data: Dataset, states: pd.DataFrame):
    found = ask(
        data,
        """
        select v.S, max(v.V) from paper.Vehicles v join paper.EgoVehicle e
            on v.S = e.S and v.F = e.F and v.ID = e.IDego
        group by 1 order by 1
        """,
    )
    ego = states[states["vehicle"] == 0].groupby("simulation")["speed_mps"].max() * 3.6
    assert [row[0] for row in found] == ego.index.tolist()
    np.testing.assert_allclose([row[1] for row in found], ego.to_numpy(), rtol=1e-12)


def test_a_window_over_frames_is_that_of_pandas(data: Dataset, states: pd.DataFrame):
    """How far each vehicle drives: a sum of differences between frames."""
    found = ask(
        data,
        """
        with steps as (
            select simulation, vehicle, s_mm - lag(s_mm) over (
                partition by simulation, vehicle order by frame) as step
            from states)
        select simulation, vehicle, sum(step) from steps group by all order by all
        """,
    )
    driven = states.sort_values("frame").groupby(["simulation", "vehicle"])["s_m"]
    expected = ((driven.last() - driven.first()) * 1000).round()
    assert [row[:2] for row in found] == expected.index.tolist()
    assert [int(row[2]) for row in found] == expected.astype(int).tolist()


def test_who_breaks_which_rule_while_following_closely_is_what_pandas_finds(data: Dataset):
    """Three tables, a condition on a decision, and a group."""
    found = ask(
        data,
        """
        select f.rule, count(distinct f.simulation)
        from findings f
        join labels l on l.simulation = f.simulation and l.policy = 'paper'
        join percepts p on p.simulation = f.simulation
        where f.verdict = 'illegal' and l.class != 'No_attempt'
            and p.leader_is_detected and p.leader_gap_mm < 60000
        group by 1 order by 1
        """,
    )
    findings, labels, percepts = data.findings(), data.labels(), data.percepts()
    tried = labels[(labels["policy"] == "paper") & (labels["class"] != "No_attempt")]
    close = percepts[percepts["leader_is_detected"] & (percepts["leader_gap_m"] < 60)]
    chosen = set(tried["simulation"]) & set(close["simulation"])
    broken = findings[(findings["verdict"] == "illegal") & findings["simulation"].isin(chosen)]
    counts = broken.groupby("rule", observed=True)["simulation"].nunique()
    assert found == sorted((str(rule), count) for rule, count in counts.items())
    assert found


def test_the_papers_views_agree_with_the_exported_table(data: Dataset):
    """The export is made by other code, from trajectories; it rounds to two places."""
    from overtaking.recordings.pinto2023 import to_table

    table = to_table(data.trajectory(3), np.array([3])).to_pylist()
    vehicles = ask(data, "select * from paper.Vehicles where S = 3 order by F, ID")
    exported = [
        [
            part
            for column in ("Dim", "L", "V", "D", "A")
            for part in list(row[column][slot].values())[1:]
        ]
        for row in table
        for slot in range(len(row["L"]))
    ]
    ours = np.array([row[5:] for row in vehicles], dtype=float)
    theirs = np.array(exported, dtype=float)
    speed = 6
    np.testing.assert_allclose(ours[:, speed], theirs[:, speed], atol=0.5001)  # Whole km/h.
    np.testing.assert_allclose(
        np.delete(ours, speed, axis=1), np.delete(theirs, speed, axis=1), atol=0.00501
    )
    names = "F, IDego + 1 as IDego, MV, RT, LT, LW, LWR, LWL, C + 1 as C, OV"  # It counts from 1.
    ego = ask(data, f"select {names} from paper.EgoVehicle where S = 3 order by F")
    names = names.replace("IDego + 1 as ", "").replace("C + 1 as ", "")
    assert ego == [tuple(row[name] for name in names.split(", ")) for row in table]
    names = "Prec, Fog, Wind, DN, HL"
    weather = ask(
        data, f"select {names} from paper.Weather join paper.Simulations using (W) where S = 3"
    )
    assert weather == [tuple(table[0][name] for name in names.split(", "))]
    times = ask(data, "select F, TS from paper.Frames where S = 3 order by F")
    assert times == [(row["F"], row["TS"]) for row in table]


# Only data sets of a policy have actions.
KEPT = [one for one in relations() if one.many != "actions"]


def faults_of(relation: Relation) -> list[str]:
    """What selects the rows that must not be there."""
    columns = ", ".join(relation.columns)
    complete = " and ".join(f"{column} is not null" for column in relation.columns)
    lost = f"select * from {relation.many} anti join {relation.one} using ({columns})"
    faults = [f"from ({lost}) where {complete}"]
    if not relation.is_optional:
        faults.append(f"from {relation.many} where not ({complete})")
    if relation.is_single:
        twice = f"select 1 from {relation.many} group by {columns} having count(*) > 1"
        faults.append(f"from ({twice})")
    return faults


def test_every_relation_of_the_diagram_holds_in_the_data(data: Dataset):
    faults = {f"{one.one}-{one.many}: {fault}": fault for one in KEPT for fault in faults_of(one)}
    (counts,) = ask(
        data, "select " + ", ".join(f"(select count(*) {one})" for one in faults.values())
    )
    assert {name: count for name, count in zip(faults, counts, strict=True) if count} == {}
    assert len({name.partition(":")[0] for name in faults}) == len(KEPT) > 10


def test_the_queries_of_the_page_are_answered(data: Dataset):
    page = Path(__file__).parents[2] / "docs" / "how-to" / "query-with-sql.md"
    queries = re.findall(r"```sql\n(.+?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    assert queries
    assert all(ask(data, query) for query in queries)


# --- what a query cannot do ---

ATTEMPTS = [
    "COPY labels TO '{file}'",
    "COPY (SELECT 1) TO '{file}'",
    "ATTACH '{file}' AS other",
    "EXPORT DATABASE '{file}'",
    "INSTALL httpfs",
    "LOAD httpfs",
    "PRAGMA enable_profiling",
    "SET enable_external_access = true",
    "SET lock_configuration = false",
    "SELECT * FROM read_csv('{secret}')",
    "SELECT * FROM read_text('{secret}')",
    "SELECT * FROM read_blob('{secret}')",
    "SELECT * FROM '{secret}'",
    "SELECT * FROM glob('{secret}*')",
    "SELECT * FROM read_parquet('{data}')",
    "SELECT 1; COPY labels TO '{file}'",
    "SELECT * FROM query('COPY labels TO ''{file}''')",
    "SELECT * FROM labels'; DROP TABLE labels; --",
    "DROP VIEW labels",
    "CREATE TABLE mine AS SELECT 1",
    "CREATE OR REPLACE SECRET (TYPE s3, KEY_ID 'a', SECRET 'b')",
    "CALL pragma_version()",
    "SELECT getenv('HOME')",
    "SELECT * FROM data",
    "SELECT * FROM sniff_csv('{secret}')",
    "SELECT * FROM arrow_scan(1, 2, 3)",  # Addresses in memory.
    "SELECT * FROM arrow_scan(1::POINTER, 2::POINTER, 3::POINTER)",
    "SELECT * FROM pandas_scan(1::POINTER)",
]


@pytest.mark.parametrize("attempt", ATTEMPTS)
def test_an_attempt_to_do_anything_else_fails_and_does_nothing(
    data: Dataset, tmp_path: Path, attempt: str
):
    secret, file = tmp_path / "secret.csv", tmp_path / "written"
    secret.write_text("word\nopensesame\n")
    before = overtaking.load_dataset(data.path).content_hash
    names = {
        "secret": str(secret),
        "file": str(file),
        "data": str(data.path / "labels").replace("'", "''"),
    }
    with pytest.raises(ConfigError) as caught:
        ot.sql(data, attempt.format(**names))
    assert "\n" not in str(caught.value)
    assert "opensesame" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["secret.csv"]
    assert overtaking.load_dataset(data.path).content_hash == before
    data.verify()


def test_a_change_of_a_table_in_memory_is_gone_with_the_answer(data: Dataset):
    before = ask(data, "select count(*) from labels")
    with pytest.raises(ConfigError):
        ot.sql(data, "with gone as (delete from labels returning *) select * from gone")
    assert ask(data, "select count(*) from labels") == before


def test_time_is_bounded(data: Dataset):
    with pytest.raises(ConfigError, match=r"within 0\.3 s"):
        ot.sql(data, "select count(*) from range(1000000000000)", timeout_s=0.3)


def test_memory_is_bounded(data: Dataset):
    wide = "select list(x) from (select repeat('a', 100000) || range as x from range(10000))"
    with pytest.raises(ConfigError, match="at most 64 MiB"):
        ot.sql(data, wide, memory_mib=64)


MEASURED = """
import resource, sys
import overtaking as ot
from overtaking.core.errors import ConfigError
try:
    ot.sql(sys.argv[1], sys.argv[2], memory_mib=128, max_rows=10**9)
except ConfigError as error:
    print(error)
# Not ru_maxrss, which counts the memory of the parent before the start.
lines = open("/proc/self/status").read().splitlines()
print(*(int(line.split()[1]) // 1024 for line in lines if line.startswith("VmHWM:")))
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="Linux alone bounds the memory of a process.")
@pytest.mark.parametrize(
    ("sql", "said"),
    [
        ("select repeat('A', 100000000) from range(1000)", "at most 128 MiB of memory"),
        ("select repeat('A', 1000000000)", "at most 128 MiB of memory"),
        ("select repeat('A', 50000000)", "an answer of at most 16 MiB"),
        ("select range from range(100000000)", "an answer of at most 16 MiB"),
        ("select list(range) from range(3000000)", "at most"),
        ("select list_resize([0], 1000000000)", "at most 128 MiB of memory"),
    ],
)
def test_memory_is_bounded_whatever_is_fetched(folder: Path, sql: str, said: str):
    command = [sys.executable, "-c", MEASURED, str(folder), sql]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    message, own, database = done.stdout.splitlines()
    assert said in message
    assert "--memory" in message
    assert int(own) < 500
    assert int(database) < 128 + 500  # What the packages take, and the pieces of files.


@pytest.mark.parametrize("width", [None, "80"])
def test_a_long_cell_is_whole_but_in_a_table(
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    width: str | None,
):
    if width is not None:
        monkeypatch.setenv("COLUMNS", width)
    sql = "select repeat('A', 100000) as x"
    assert run(capsys, "sql", folder, sql, "--format", "csv").count("A") == 100_000
    table = run(capsys, "sql", folder, sql)
    assert table.count("A") == 1000
    assert "…" in table


def test_rows_are_bounded_without_making_the_others(data: Dataset):
    answer = ot.sql(data, "select * from range(1000000000000)", max_rows=3)
    assert answer.rows == [(0,), (1,), (2,)]
    assert answer.is_cut


@pytest.mark.parametrize(
    "bounds", [{"max_rows": 0}, {"timeout_s": 0}, {"timeout_s": math.nan}, {"memory_mib": 1}]
)
def test_a_bound_that_is_none_is_refused(data: Dataset, bounds: dict[str, Any]):
    with pytest.raises(ConfigError, match="or more"):
        ot.sql(data, "select 1", **bounds)


@pytest.mark.parametrize("sql", ["", ";", "seek", "select * from nowhere", "select 'x"])
def test_a_mistake_is_one_line(data: Dataset, sql: str):
    with pytest.raises(ConfigError) as caught:
        ot.sql(data, sql)
    assert "\n" not in str(caught.value)


def test_a_damaged_file_is_noticed_by_a_question_about_it(tmp_path: Path):
    path = tmp_path / "small"
    ot.generate_dataset("pinto2023-physical", num_simulations=3, seed=1, out=path, keep="features")
    file = next((path / "labels").glob("*.parquet"))
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    data = overtaking.load_dataset(path)
    for sql in ("select count(*) from LABELS", "select count(*) from paper.simulations"):
        with pytest.raises(DatasetError, match="the bytes that were written"):
            ot.sql(data, sql)
    assert ask(data, "select count(*) from vehicles")[0][0] > 3
    with pytest.raises(ConfigError, match="EgoVehicle"):
        ot.sql(data, "select * from paper.EgoVehicle")  # Frames were not kept.


# --- the command line ---


def run(capsys: pytest.CaptureFixture[str], *arguments: Any) -> str:
    assert main([str(one) for one in arguments]) == 0
    return capsys.readouterr().out


QUESTION = "select simulation, profile, trace_hash from simulations order by 1"


def test_the_three_forms_say_the_same(folder: Path, capsys: pytest.CaptureFixture[str]):
    as_json = json.loads(run(capsys, "sql", folder, QUESTION, "--format", "json"))
    assert as_json == json.loads(run(capsys, "sql", folder, QUESTION, "--json"))
    rows = list(csv.reader(io.StringIO(run(capsys, "sql", folder, QUESTION, "--format", "csv"))))
    assert rows[0] == as_json["columns"]
    assert rows[1:] == [[str(cell) for cell in row] for row in as_json["rows"]]
    assert len(rows) == SIMULATIONS + 1
    table = run(capsys, "sql", folder, QUESTION)
    assert f"{SIMULATIONS} rows" in table
    assert as_json["rows"][-1][2][:8] in table


def test_rows_that_are_left_out_are_said_to_be(folder: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["sql", str(folder), QUESTION, "--rows", "2", "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["is_cut"]
    assert len(json.loads(said.out)["rows"]) == 2
    assert "--rows" in said.err


def test_a_terminal_obeys_nothing_in_an_answer(folder: Path, capsys: pytest.CaptureFixture[str]):
    out = run(capsys, "sql", folder, "select chr(27) || '[2Jx' as \"a\x1bb\", '[red]y' as z")
    assert "\x1b" not in out
    assert "[red]y" in out


def test_what_json_has_no_word_for_is_null_or_text(
    folder: Path, capsys: pytest.CaptureFixture[str]
):
    sql = "select 'nan'::double, 'inf'::float, null, date '2026-01-02', [1.5, null], 1.5::decimal"
    row = json.loads(run(capsys, "sql", folder, sql, "--json"))["rows"][0]
    assert row == [None, None, None, "2026-01-02", ["1.5", None], "1.500"]


def test_the_diagram_appears_whole_in_its_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "er.svg"
    run(capsys, "er", "--out", out)
    assert out.read_text() == run(capsys, "er")
    assert [path.name for path in tmp_path.iterdir()] == ["er.svg"]
    assert run(capsys, "er", "--format", "mermaid").startswith("erDiagram")
    assert main(["er", "--format", "png"]) == 2


# --- the literature ---


def test_a_row_of_ones_own_is_computed_from_the_data(
    folder: Path, data: Dataset, capsys: pytest.CaptureFixture[str]
):
    found = json.loads(run(capsys, "literature", "datasets", "--snow", "--own", folder, "--json"))
    assert [row["id"] for row in found["rows"][:-1]] == [
        *("vistas", "apolloscape", "bdd100k", "pandaset", "acdc")
    ]
    own = found["rows"][-1]
    simulations, weather = data.simulations(), data.weather()
    seconds = simulations["num_frames"] * simulations["frame_interval_s"]
    assert own["num_scenes"] == SIMULATIONS
    assert own["duration_h"] == pytest.approx(seconds.sum() / 3600)
    assert own["num_annotated_frames"] == simulations["num_frames"].sum()
    assert own["max_classes"] == data.vehicles()["kind"].nunique()
    assert ("night" in own["conditions"]) == weather["night"].any()
    assert ("rain" in own["conditions"]) == (weather["rain_percent"] > 0).any()
    assert own["doubts"] == []


@pytest.mark.parametrize("table", ["systems", "datasets", "factors", "studies"])
def test_a_table_of_the_literature_is_shown(
    table: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("COLUMNS", "80")
    rows = json.loads(run(capsys, "literature", table, "--json"))["rows"]
    text = run(capsys, "literature", table)
    assert all(row["name"].split()[0] in text for row in rows)


def test_a_corrected_value_has_a_star_and_a_printed_one_has_none(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("COLUMNS", "200")
    assert "0.23*" in run(capsys, "literature", "datasets", "--snow", "--boxes3d")
    printed = run(capsys, "literature", "datasets", "--snow", "--boxes3d", "--as-printed")
    assert "1,000" in printed
    assert "*" not in printed
    assert "? PandaSet: less than an image in ten seconds." in printed
