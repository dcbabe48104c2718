"""The literature is what the paper prints, corrected where a source shows it, and stays typed."""

from __future__ import annotations

import dataclasses
import shutil
from typing import TYPE_CHECKING

import pytest

from overtaking.analysis.literature import datasets, factors, reading, references, studies, systems
from overtaking.analysis.literature.answers import TABLES, WORDS, answer, doubts, select
from overtaking.analysis.literature.records import MEMBERS
from overtaking.core.errors import ConfigError, KnowledgeError
from overtaking.data.tables.schemas import SCHEMAS
from overtaking.knowledge import toml_reader
from overtaking.knowledge.toml_reader import DATA_FOLDER

if TYPE_CHECKING:
    from pathlib import Path

YANG = (65.1, 79.8, 83.0, 87.0, 88.4, 89.1, 89.4, 89.5, 89.5, 89.5)
"""The accuracies of the paper's table of Yang et al., copied from the paper."""

# The paper's table, copied column by column from its source: names, 3D boxes, night to dawn.
NAMES = (
    "Kitti Cityscapes CamVid Vistas Waymo_Open Lyft_Level_5 nuScenes ApolloScape KAIST BDD100K "
    "H3D PandaSet ACDC"
)
BOXES = "YNNNYYYYNNYYY"
NIGHT = "NNNYYNYYYYNYY"
RAIN = "NNNYYNYYNYNYY"
SNOW = "NNNYNNNYNYNYY"
DAWN = "NNNYYNYNYYNNN"
HIGHWAY = "YNNYYNNYNYNYY"
LIDAR = "YNNNYYYYYNYYN"
PIXEL = "NYYYNNNYNYNYY"
THREE_D = "YNNNYYYNNNYYY"
IMAGES = "15k 25k 18k 25k 1M 323k 1.4M 144k 8.9k 100M 83k 48k 4k"
CLASSES = "8 30 32 152 4 9 23 35 3 10 8 28 19"


def number(text: str) -> int:
    """A number as the paper writes it: 1.4M."""
    factor = {"k": 1e3, "M": 1e6}.get(text[-1], 1.0)
    return round(float(text.rstrip("kM")) * factor)


def yes(row: bool) -> str:
    return "Y" if row else "N"


def test_the_tables_have_the_papers_rows():
    assert len(systems()) == 10
    assert [one.name.replace(" ", "_") for one in datasets().values()] == NAMES.split()
    assert [one.kind for one in factors().values()] == ["explicit"] * 7 + ["implicit"] * 3
    assert len(studies()) == 8


@pytest.mark.parametrize(
    ("column", "word", "printed"),
    [
        ("conditions", "night", NIGHT),
        ("conditions", "rain", RAIN),
        ("conditions", "snow", SNOW),
        ("conditions", "dawn", DAWN),
        ("traffic", "highway", HIGHWAY),
        ("sensors", "lidar", LIDAR),
        ("annotations", "pixel", PIXEL),
        ("annotations", "3d", THREE_D),
    ],
)
def test_the_marks_are_those_that_the_paper_prints(column: str, word: str, printed: str):
    rows = datasets(is_corrected=False).values()
    assert "".join(yes(word in getattr(row, column)) for row in rows) == printed


def test_the_numbers_are_those_that_the_paper_prints():
    rows = list(datasets(is_corrected=False).values())
    assert [row.num_images for row in rows] == [number(one) for one in IMAGES.split()]
    assert [row.max_classes for row in rows] == [int(one) for one in CLASSES.split()]
    assert "".join(yes(row.boxes_3d) for row in rows) == BOXES
    assert [one.sae_level for one in systems(is_corrected=False).values()] == [
        *(0, 0, 0, 1, 1, 1, 2, 3, 3, 4)
    ]


def test_a_correction_keeps_what_is_printed_and_says_who_knows_better():
    seen = 0
    for table in (systems, datasets):
        printed = table(is_corrected=False)
        for id_, row in table().items():
            for one in row.corrections:
                seen += 1
                assert getattr(row, one.column) == one.value != one.printed
                assert getattr(printed[id_], one.column) == one.printed
                assert references()[one.source].checked, "only a source that was read corrects"
                assert one.source != "pinto-2023"
                assert one.why
    assert seen >= 9


def test_the_length_of_pandaset_is_that_of_its_scenes():
    row = datasets()["pandaset"]
    assert row.duration_h == pytest.approx((row.num_scenes or 0) * 8 / 3600, abs=0.005)


def test_corrections_leave_no_contradiction_that_they_claim_to_solve():
    before = {row.id: doubts(row) for row in datasets(is_corrected=False).values()}
    after = {row.id: doubts(row) for row in datasets().values()}
    assert before["pandaset"] == ["less than an image in ten seconds"]
    assert "3D boxes in one half of the table only" in before["apolloscape"]
    assert after["pandaset"] == after["acdc"] == []
    assert after["apolloscape"] == ["lidar, or its clouds, missing", "more scenes than images"]
    assert all(set(after[id_]) <= set(before[id_]) for id_ in before)


def test_a_choice_is_what_has_all_that_is_wanted():
    wanted = ("night", "rain", "highway", "boxes3d")
    chosen = {row.id for row in select(datasets().values(), wanted)}
    assert chosen == {"waymo", "apolloscape", "pandaset"}
    assert {row.id for row in select(datasets(is_corrected=False).values(), wanted)} == {
        *chosen,
        "acdc",
    }
    assert len(select(datasets().values(), ())) == 13


def test_what_can_be_wanted_is_what_the_columns_hold():
    assert {*WORDS} == {word for words in MEMBERS.values() for word in words} | {"boxes3d"}
    with pytest.raises(ConfigError, match="fog"):
        select(datasets().values(), ("fog",))


def test_yang_ranks_as_in_the_papers_table():
    assert tuple(one.accuracy_percent for one in studies()["yang-2021"].factors) == YANG
    assert list(YANG) == sorted(YANG)


def columns_linked() -> list[str]:
    linked = [column for row in factors().values() for column in row.columns]
    return linked + [
        column for row in studies().values() for one in row.factors for column in one.columns
    ]


@pytest.mark.parametrize("column", sorted(set(columns_linked())))
def test_a_column_that_a_factor_is_linked_to_exists(column: str):
    table, name = column.split(".")
    assert name in SCHEMAS[table].names


def test_every_reference_is_cited():
    cited = {id_ for table in TABLES for id_ in answer(table)["references"]}
    assert cited == set(references())


def test_an_answer_cites_what_its_rows_name():
    found = answer("datasets", wanted=("snow",))
    assert {"pinto-2023", "acdc-2021", "vistas-2017"} <= set(found["references"])
    assert "kitti-2012" not in found["references"]
    with pytest.raises(ConfigError, match="tables"):
        answer("tables")


def test_records_cannot_be_changed():
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(datasets()["kitti"], "year", 1)  # noqa: B010


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A copy of the files that a test may spoil."""
    caches = (
        toml_reader.load_toml,
        reading.systems,
        reading.datasets,
        reading.factors,
        reading.studies,
    )
    shutil.copytree(DATA_FOLDER / "literature", tmp_path / "literature")
    monkeypatch.setattr(toml_reader, "DATA_FOLDER", tmp_path)
    for one in caches:
        one.cache_clear()
    yield tmp_path / "literature"
    monkeypatch.undo()
    for one in caches:
        one.cache_clear()


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("systems", "sae_level = 4", "sae_level = 6", "sae_level: .*5, got 6"),
        ("systems", 'comfort = "+"', 'comfort = "nice"', "comfort: .*got nice"),
        ("systems", "value = 0", "value = 2", "another value than the printed one"),
        ("systems", 'source = "sae-j3016"', 'source = "hearsay"', "got hearsay"),
        ("datasets", "year = 2012", 'year = "2012"', "year: .*a valid integer, got 2012"),
        ("datasets", "year = 2012", "years = 2012", "years: .*[Uu]nexpected"),
        ("datasets", "boxes_3d = true", "boxes_3d = 1", "boxes_3d: .*a valid boolean, got 1"),
        ("datasets", '"night"', '"nite"', "got nite"),
        ("factors", 'kind = "implicit"', 'kind = "vague"', "got vague"),
        ("studies", 'category = "A"', 'category = "D"', "got D"),
    ],
)
def test_a_mistake_in_a_file_is_named(folder: Path, file: str, old: str, new: str, said: str):
    path = folder / f"{file}.toml"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(KnowledgeError, match=said):
        getattr(reading, file)()
