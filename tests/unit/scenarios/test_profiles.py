import copy
import json
import re
import tomllib
from pathlib import Path

import pytest

from overtaking.core.errors import ConfigError
from overtaking.scenarios.profiles import PROFILE_FOLDER, load_specification, profile_names
from overtaking.scenarios.specification import FixedTraits, Specification, StartsSection
from overtaking.scenarios.traffic_specification import PlacedTraffic

PINTO = "pinto2023-physical"


def test_the_profiles_of_the_package_are_valid_and_carry_their_names():
    assert PINTO in profile_names()
    for name in profile_names():
        assert load_specification(name).name == name


def traffic_of(overrides=None) -> PlacedTraffic:
    traffic = load_specification(PINTO, overrides).traffic
    assert isinstance(traffic, PlacedTraffic)
    return traffic


def test_the_profile_of_the_study_says_what_the_study_says():
    study, traffic = load_specification(PINTO), traffic_of()
    assert study.road == "town06"
    assert traffic.vehicles == (2, 6)
    assert traffic.speed_kmh == (50.0, 120.0)
    assert traffic.spawn_x_m == (320.0, 450.0)
    assert set(traffic.types) == {"S", "M", "L", "V", "T", "MC", "B"}
    assert set(traffic.ego_types) == {"S", "M", "L", "V", "T"}
    assert len(traffic.colours) == 8
    assert study.weather.mode == "presets"
    assert set(study.weather.presets) == {
        "ClearNoon",
        "HardRainNoon",
        "ClearSunset",
        "ClearNight",
        "CloudyNight",
        "SoftRainNight",
        "MidRainyNight",
        "HardRainNight",
    }
    assert study.time.attempt_deadline_s == 8.0
    assert study.profile.frame_interval_ms == 50


def test_a_resolved_specification_is_read_back_as_itself():
    given = load_specification(
        PINTO, {"weather.mode": "independent", "drivers.fixed.time_gap_s": "1.5"}
    )
    as_json = json.loads(json.dumps(given.to_dict()))
    assert load_specification(as_json) == given
    assert load_specification(as_json).specification_hash == given.specification_hash
    assert load_specification(given) == given


def test_the_hash_depends_on_what_is_said_and_not_on_how(tmp_path):
    text = (PROFILE_FOLDER / f"{PINTO}.toml").read_text(encoding="utf-8")
    shuffled = tmp_path / "shuffled.toml"
    shuffled.write_text("\n\n".join(reversed(text.split("\n\n"))), encoding="utf-8")
    assert (
        load_specification(shuffled).specification_hash
        == load_specification(PINTO).specification_hash
    )
    assert (
        load_specification(PINTO, {"traffic.vehicles": "2..5"}).specification_hash
        != load_specification(PINTO).specification_hash
    )


def test_canonical_json_is_one_sorted_line():
    text = load_specification(PINTO).canonical_json()
    assert "\n" not in text
    assert json.loads(text) == load_specification(PINTO).to_dict()
    assert list(json.loads(text)) == sorted(json.loads(text))


def test_a_specification_cannot_be_changed():
    study = load_specification(PINTO)
    with pytest.raises(ValueError, match="frozen"):
        study.profile.name = "other"


@pytest.mark.parametrize(
    ("key", "text", "expected"),
    [
        ("traffic.vehicles", "2..5", (2, 5)),
        ("traffic.vehicles", "[2, 5]", (2, 5)),
        ("traffic.vehicles", " 2 .. 5 ", (2, 5)),
        ("traffic.speed_kmh", "60.5..90", (60.5, 90.0)),
        ("traffic.ego_lanes", "[0, 2]", (0, 2)),
        ("time.horizon_s", "30", 30.0),
        ("starts.allow_doomed", "true", True),
        ("profile.name", "night-only", "night-only"),
        ("profile.name", "'quoted'", "quoted"),
        ("traffic.colours", "red", {"red": 1.0}),
        ("traffic.colours", "['red', 'blue']", {"red": 1.0, "blue": 1.0}),
        ("traffic.types", "{S = 2, T = 1}", {"S": 2.0, "T": 1.0}),
    ],
)
def test_an_override_may_be_a_text(key, text, expected):
    section, name = key.split(".")
    assert getattr(getattr(load_specification(PINTO, {key: text}), section), name) == expected


def test_an_override_may_change_one_weight():
    assert traffic_of({"traffic.types.B": "0"}).types["B"] == 0.0
    assert traffic_of({"traffic.types.B": 0}).types["S"] == 1.0


def test_the_other_zone_replaces_the_first():
    changed = traffic_of({"traffic.spawn_s_m": "10..150"})
    assert (changed.spawn_x_m, changed.spawn_s_m) == (None, (10.0, 150.0))


def test_the_other_mode_of_the_weather_replaces_its_keys():
    changed = load_specification(
        PINTO, {"weather.mode": "independent", "weather.rain_probability": "0.2"}
    )
    assert changed.weather.mode == "independent"
    assert changed.weather.rain_probability == 0.2


def test_the_mode_of_a_weather_without_one_keeps_its_keys():
    table = load_specification(PINTO, {"weather.mode": "independent"}).to_dict()
    table["weather"] = {"rain_probability": 0.3}
    weather = load_specification(table, {"weather.mode": "independent"}).weather
    assert weather.mode == "independent"
    assert weather.rain_probability == 0.3


def test_defaults_are_those_of_the_models(tmp_path):
    table = tomllib.loads((PROFILE_FOLDER / f"{PINTO}.toml").read_text(encoding="utf-8"))
    del table["starts"]
    assert load_specification(table).starts == StartsSection()
    assert StartsSection() == load_specification(PINTO, {"starts.min_gap_m": 10.0}).starts


MISTAKES = {
    # What is wrong: (key, value, what the message must say beside file and key).
    "unknown key": ("traffic.vehicls", "2..4", "did you mean vehicles?"),
    "unknown section": ("traffic_.vehicles", "2..4", "did you mean traffic?"),
    "nothing like a key": ("traffic.qqq", "1", "choose from vehicles, types"),
    "key of the other weather": ("weather.rain_percent", "1..2", "choose from mode, presets"),
    "unknown fixed parameter": ("drivers.fixed.time_gap", "1", "did you mean time_gap_s?"),
    "unknown preset": ("weather.presets.ClearNon", "1", "did you mean ClearNoon?"),
    "unknown preset by name": ("weather.presets", "midrainynight", "did you mean MidRainyNight?"),
    "unknown type": ("traffic.types.X", "1", "choose from S, M, L, V, T, MC, B"),
    "unknown colour": ("traffic.colours.gray", "1", "did you mean grey?"),
    "unknown road": ("profile.road", "town6", "did you mean town06?"),
    "unknown population": ("drivers.population", "mixd", "did you mean mixed?"),
    "unknown mode": ("weather.mode", "random", 'mode = "presets" or mode = "independent"'),
    "two-wheeled ego": ("traffic.ego_types.MC", "1", "leave MC out"),
    "upside down": ("traffic.speed_kmh", "120..50", "write [50, 120]"),
    "upside down count": ("traffic.vehicles", "6..2", "write [2, 6]"),
    "upside down zone": ("traffic.spawn_x_m", "450..320", "write [320, 450]"),
    "too many vehicles": ("traffic.vehicles", "2..33", "less than or equal to 32"),
    "too few vehicles": ("traffic.vehicles", "1..3", "greater than or equal to 2"),
    "half a vehicle": ("traffic.vehicles", "2..4.5", "a whole number"),
    "one limit": ("traffic.speed_kmh", "[50]", "a value, got nothing"),
    "three limits": ("traffic.speed_kmh", "[50, 60, 70]", "2 values"),
    "no list": ("traffic.speed_kmh", "50", "a list"),
    "no table": ("traffic", "50", "a table"),
    "negative weight": ("traffic.types.S", "-1", "greater than or equal to 0"),
    "zero weights": ("traffic.types", "{S = 0}", "a weight above zero"),
    "no weights": ("weather.presets", "{}", "a weight above zero"),
    "numbers for names": ("traffic.colours", "[1, 2]", "quote the names"),
    "weight that is a text": ("traffic.types.S", "many", "a number"),
    "NaN": ("traffic.speed_kmh", "[nan, 100]", "a finite number"),
    "infinity": ("time.horizon_s", "inf", "got inf"),
    "negative time": ("time.horizon_s", "-1", "greater than or equal to 0.01"),
    "endless": ("time.horizon_s", "1e9", "less than or equal to 600"),
    "negative speed": ("traffic.speed_kmh", "-50..50", "greater than 0"),
    "negative exponent": ("traffic.leader_speed_exponent", "-1", "greater than 0"),
    "deadline after the end": ("time.attempt_deadline_s", "21", "at most the horizon of 20"),
    "frames between steps": ("profile.frame_interval_ms", "45", "a multiple of 10"),
    "frames that are a number with a point": ("profile.frame_interval_ms", "50.0", "whole number"),
    "nameless": ("profile.name", "''", "at least 1 character"),
    "number for yes": ("starts.allow_doomed", "1", "true or false"),
    "text for a number": ("starts.min_gap_m", "far", "a number"),
    "gap too small": ("starts.min_gap_m", "0.1", "greater than or equal to 3"),
    "driving style beyond reckless": (
        "drivers.driving_style",
        "0.5..1.5",
        "less than or equal to 1",
    ),
    "no brakes": ("drivers.fixed.decel_mps2", "0", "greater than or equal to 0.01"),
    "lane twice": ("traffic.ego_lanes", "[1, 1]", "each lane once"),
    "no lane": ("traffic.ego_lanes", "[]", "1 values"),
    "lane below zero": ("traffic.ego_lanes", "[-1]", "greater than or equal to 0"),
}


@pytest.mark.parametrize(("key", "value", "says"), MISTAKES.values(), ids=list(MISTAKES))
def test_a_mistake_is_one_line_with_place_and_remedy(key, value, says):
    with pytest.raises(ConfigError) as caught:
        load_specification(PINTO, {key: value})
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{PINTO}.toml: {key.split('.')[0]}")
    assert says in message
    assert "expected" in message
    assert "got" in message
    assert message.rpartition("; ")[2]


@pytest.mark.parametrize("profile", profile_names())
@pytest.mark.parametrize("value", [1e308, -1e308, 10**30])
def test_every_number_has_a_range(profile, value):
    given = load_specification(profile).to_dict()
    given["drivers"] |= PEOPLE
    for *way, last in numbers_in(given):
        table = part = copy.deepcopy(given)
        for key in way:
            part = part[key]
        part[last] = value
        with pytest.raises(ConfigError, match=f"got .*{re.escape(str(value))}"):
            load_specification(table)


PEOPLE = {
    "fixed": dict.fromkeys(FixedTraits.model_fields, 0.5),
    "scale": {"patience": 1.0},
}


def numbers_in(table, way=()):
    """The path of each number in nested tables and lists."""
    items = table.items() if isinstance(table, dict) else enumerate(table)
    for key, value in items:
        if isinstance(value, dict | list):
            yield from numbers_in(value, (*way, key))
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield (*way, key)


def test_a_mistake_in_the_other_weather_is_found():
    with pytest.raises(ConfigError, match=r"weather\.fog_percent\.1: .* less than or equal to 100"):
        load_specification(PINTO, {"weather.mode": "independent", "weather.fog_percent": "0..101"})
    with pytest.raises(ConfigError, match="did you mean rain_percent"):
        load_specification(PINTO, {"weather.mode": "independent", "weather.rain_prcent": "0..100"})


def test_exactly_one_zone_is_wanted():
    table = load_specification(PINTO).to_dict()
    table["traffic"]["spawn_s_m"] = [1, 2]
    with pytest.raises(ConfigError, match="exactly one of spawn_x_m and spawn_s_m, got both"):
        load_specification(table)
    del table["traffic"]["spawn_x_m"], table["traffic"]["spawn_s_m"]
    with pytest.raises(ConfigError, match="exactly one of spawn_x_m and spawn_s_m, got neither"):
        load_specification(table)


def test_a_missing_key_is_no_default():
    table = load_specification(PINTO).to_dict()
    del table["traffic"]["speed_kmh"]
    with pytest.raises(ConfigError, match=r"traffic\.speed_kmh: expected a value, got nothing"):
        load_specification(table)


@pytest.mark.parametrize("key", ["", ".", "traffic.", ".vehicles", "traffic..vehicles"])
def test_an_override_needs_a_key(key):
    with pytest.raises(ConfigError, match="name section and key"):
        load_specification(PINTO, {key: 1})


def test_an_override_cannot_reach_into_a_value():
    with pytest.raises(ConfigError, match="expected a table"):
        load_specification(PINTO, {"profile.name.first": "x"})


def test_an_unknown_profile_is_answered_with_the_known_one():
    with pytest.raises(ConfigError, match="did you mean pinto2023"):
        load_specification("pinto-2023")


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"mine\.toml: file: .* check the path"):
        load_specification(tmp_path / "mine.toml")


def test_a_file_that_is_no_toml_is_refused(tmp_path):
    broken = tmp_path / "broken.toml"
    broken.write_text("[profile\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="correct the file"):
        load_specification(str(broken))


def test_a_file_is_read_like_a_profile(tmp_path):
    copy = tmp_path / "mine.toml"
    copy.write_bytes((PROFILE_FOLDER / f"{PINTO}.toml").read_bytes())
    assert load_specification(copy) == load_specification(str(copy)) == load_specification(PINTO)
    assert isinstance(load_specification(copy), Specification)


def test_a_profile_with_a_byte_order_mark_is_read(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_bytes(b"\xef\xbb\xbf" + (PROFILE_FOLDER / "motorway.toml").read_bytes())
    assert load_specification(path) == load_specification("motorway")


def test_a_data_set_in_place_of_a_profile_is_named_as_such(workdir):
    folder = Path("a folder")  # A longer path would be cut off in the message.
    folder.mkdir()
    with pytest.raises(ConfigError, match="expected the name of a profile or a TOML file, got a f"):
        load_specification(folder)
    (folder / "dataset.json").write_text("{}", encoding="utf-8")
    with pytest.raises(ConfigError, match=f"got a data set; .*overtaking info '{folder}'"):
        load_specification(str(folder))


@pytest.mark.parametrize(
    ("key", "advice"),
    [("weathers", "did you mean weather?"), ("traffics", "did you mean traffic?")],
)
def test_an_unknown_key_is_named_before_the_key_that_is_missing(key, advice):
    table = load_specification(PINTO).to_dict()
    table[key] = table.pop({"weathers": "weather", "traffics": "traffic"}[key])
    with pytest.raises(ConfigError, match=re.escape(f"{key}: expected a known key, got '{key}'")):
        load_specification(table)
    with pytest.raises(ConfigError, match=re.escape(advice)):
        load_specification(table)


def test_an_unknown_key_of_a_section_without_a_mode_is_named():
    table = load_specification(PINTO).to_dict()
    table["weather"] = {"modes": "presets", "presets": ["ClearNoon"]}
    with pytest.raises(ConfigError, match=r"got the key modes; did you mean mode\?"):
        load_specification(table)


def test_the_ego_of_a_two_way_road_starts_beyond_the_end_of_its_traffic():
    with pytest.raises(ConfigError, match=r"traffic\.start_s_m.*more than 50 m"):
        load_specification("rural", {"traffic.start_s_m": [0.0, 40.0]})
    assert load_specification("rural", {"traffic.start_s_m": [50.1, 60.0]})


def test_the_share_of_the_busier_direction_is_at_least_one_half():
    """A smaller one would make the other direction busier than the check of the flow assumes."""
    with pytest.raises(ConfigError, match=r"traffic\.split.*0\.5"):
        load_specification("rural", {"traffic.split": [0.0, 0.1]})
    with pytest.raises(ConfigError, match=r"traffic\.flow_vph.*busier direction"):
        load_specification("rural", {"traffic.split": [0.9, 0.9], "traffic.flow_vph": [1300, 1300]})
