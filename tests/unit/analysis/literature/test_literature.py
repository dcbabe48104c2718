"""The literature tables equal the paper's tables, except for corrections that a source supports."""

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
"""Accuracies of Yang et al. [%], copied from the paper."""

# Columns of the paper's table of data sets, copied from its source. Y is a mark, N is no mark.
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


def parsed_number(text: str) -> int:
    """Parse a number as the paper writes it, such as 1.4M."""
    factor = {"k": 1e3, "M": 1e6}.get(text[-1], 1.0)
    return round(float(text.rstrip("kM")) * factor)


def mark(is_marked: bool) -> str:
    return "Y" if is_marked else "N"


def test_the_tables_have_the_rows_of_the_paper():
    assert len(systems()) == 10
    assert [row.name.replace(" ", "_") for row in datasets().values()] == NAMES.split()
    assert [row.kind for row in factors().values()] == ["explicit"] * 7 + ["implicit"] * 3
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
def test_the_uncorrected_marks_of_data_sets_equal_the_paper(column: str, word: str, printed: str):
    rows = datasets(is_corrected=False).values()
    assert "".join(mark(word in getattr(row, column)) for row in rows) == printed


def test_the_uncorrected_numbers_of_data_sets_and_systems_equal_the_paper():
    rows = list(datasets(is_corrected=False).values())
    assert [row.num_images for row in rows] == [parsed_number(text) for text in IMAGES.split()]
    assert [row.max_classes for row in rows] == [int(text) for text in CLASSES.split()]
    assert "".join(mark(row.boxes_3d) for row in rows) == BOXES
    assert [system.sae_level for system in systems(is_corrected=False).values()] == [
        *(0, 0, 0, 1, 1, 1, 2, 3, 3, 4)
    ]


def test_a_correction_keeps_the_printed_value_and_names_a_source_other_than_the_paper():
    num_corrections = 0
    for table in (systems, datasets):
        printed = table(is_corrected=False)
        for id_, row in table().items():
            for correction in row.corrections:
                num_corrections += 1
                assert getattr(row, correction.column) == correction.value != correction.printed
                assert getattr(printed[id_], correction.column) == correction.printed
                assert references()[correction.source].checked, (
                    "only a source that was read corrects"
                )
                assert correction.source != "pinto-2023"
                assert correction.why
    assert num_corrections >= 9


def test_the_duration_of_pandaset_is_8_s_for_each_scene():
    row = datasets()["pandaset"]
    assert row.duration_h == pytest.approx((row.num_scenes or 0) * 8 / 3600, abs=0.005)


def test_corrections_remove_contradictions_and_add_none():
    printed_doubts = {row.id: doubts(row) for row in datasets(is_corrected=False).values()}
    corrected_doubts = {row.id: doubts(row) for row in datasets().values()}
    assert printed_doubts["pandaset"] == ["less than an image in ten seconds"]
    assert "3D boxes in one half of the table only" in printed_doubts["apolloscape"]
    assert corrected_doubts["pandaset"] == corrected_doubts["acdc"] == []
    assert corrected_doubts["apolloscape"] == [
        "lidar, or its clouds, missing",
        "more scenes than images",
    ]
    assert all(set(corrected_doubts[id_]) <= set(printed_doubts[id_]) for id_ in printed_doubts)


def test_selected_data_sets_have_all_wanted_features():
    features = ("night", "rain", "highway", "boxes3d")
    selected = {row.id for row in select(datasets().values(), features)}
    assert selected == {"waymo", "apolloscape", "pandaset"}
    assert {row.id for row in select(datasets(is_corrected=False).values(), features)} == {
        *selected,
        "acdc",
    }
    assert len(select(datasets().values(), ())) == 13


def test_features_that_can_be_wanted_are_the_values_of_the_columns():
    assert {*WORDS} == {word for words in MEMBERS.values() for word in words} | {"boxes3d"}
    with pytest.raises(ConfigError, match="fog"):
        select(datasets().values(), ("fog",))


def test_factors_of_yang_have_the_accuracies_of_the_paper_in_ascending_order():
    assert tuple(factor.accuracy_percent for factor in studies()["yang-2021"].factors) == YANG
    assert list(YANG) == sorted(YANG)


def linked_columns() -> list[str]:
    linked = [column for row in factors().values() for column in row.columns]
    return linked + [
        column for row in studies().values() for factor in row.factors for column in factor.columns
    ]


@pytest.mark.parametrize("column", sorted(set(linked_columns())))
def test_every_column_linked_to_a_factor_exists(column: str):
    table, name = column.split(".")
    assert name in SCHEMAS[table].names


def test_the_tables_cite_every_reference():
    cited = {id_ for table in TABLES for id_ in answer(table)["references"]}
    assert cited == set(references())


def test_an_answer_cites_the_sources_of_its_rows_only():
    snow_answer = answer("datasets", wanted=("snow",))
    assert {"pinto-2023", "acdc-2021", "vistas-2017"} <= set(snow_answer["references"])
    assert "kitti-2012" not in snow_answer["references"]
    with pytest.raises(ConfigError, match="tables"):
        answer("tables")


def test_records_cannot_be_changed():
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(datasets()["kitti"], "year", 1)  # noqa: B010


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A copy of the files of the literature that a test may change."""
    caches = (
        toml_reader.load_toml,
        reading.systems,
        reading.datasets,
        reading.factors,
        reading.studies,
    )
    shutil.copytree(DATA_FOLDER / "literature", tmp_path / "literature")
    monkeypatch.setattr(toml_reader, "DATA_FOLDER", tmp_path)
    for cache in caches:
        cache.cache_clear()
    yield tmp_path / "literature"
    monkeypatch.undo()
    for cache in caches:
        cache.cache_clear()


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
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
def test_a_mistake_in_a_file_is_refused_with_its_key_or_value(
    folder: Path, file: str, old: str, new: str, message: str
):
    path = folder / f"{file}.toml"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(KnowledgeError, match=message):
        getattr(reading, file)()
