"""What a frame shows is what was recorded: positions, lamps, collisions, breaches, targets."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.support.drawing import drawn
from tests.support.worlds import Vehicle, scenario, wide_road

import overtaking as ot
from overtaking.core.errors import ConfigError
from overtaking.labels.law.judging import STORED_POLICIES, stored_policy
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.trajectories import Lights, Stage
from overtaking.model.vehicles import Colour, VehicleKind
from overtaking.model.verdicts import Findings, OvertakeClass
from overtaking.show.video.canvas import HEIGHT, WIDTH, Canvas
from overtaking.show.video.film import Film, explained
from overtaking.show.video.notes import articles_of, breaches
from overtaking.show.video.palette import ASIDE, EGO, STAGES, TARGET, WARNING
from overtaking.show.video.panel import Timeline
from overtaking.show.video.scene import scene
from overtaking.show.video.text import lettering
from overtaking.show.video.vehicles import Body, lamps
from overtaking.show.video.view import SCENE_BOTTOM, SCENE_TOP, view

MM = 1e-3
RING = 0.45  # Metres from the body to the outer edge of a mark.


def near(picture, colour: str, reach: int = 40):
    """Where a picture has about a colour."""
    meant = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)])
    return np.abs(picture.astype(int) - meant).max(axis=-1) <= reach


def marked(film: Film, frame: int, colour: str, index: int):
    """Columns and rows, from the middle of a vehicle, that have the colour of its mark.

    Its name has the same colour and lies above or below, so only its lane is looked at.
    """
    picture = film.draw(frame).to_rgb()[SCENE_TOP:SCENE_BOTTOM]
    body, scale = film.scene.bodies[index], film.view.scale
    reach = round((0.5 * body.width + RING) * scale) + 1
    middle = round(film.view.y(float(film.scene.d[index, frame])))
    first = max(middle - reach, 0)
    rows, columns = np.nonzero(near(picture[first : middle + reach + 1], colour))
    return rows + first, columns


@pytest.mark.parametrize("frame", [0, 17, 40])
def test_ego_and_target_are_pictured_as_far_apart_as_they_were_recorded(run, film, frame):
    """The camera drops out of the difference, so nothing of ours but the scale is believed."""
    s, d = (one[0].astype(float) * MM for one in (run.states.s, run.states.d))
    ego_rows, ego_columns = marked(film, frame, EGO, 0)
    target_rows, target_columns = marked(film, frame, TARGET, 1)
    scale = film.view.scale
    middle = [0.5 * (c.min() + c.max()) for c in (ego_columns, target_columns)]
    assert (middle[1] - middle[0]) / scale == pytest.approx(s[1, frame] - s[0, frame], abs=0.1)
    rows = [0.5 * (r.min() + r.max()) for r in (ego_rows, target_rows)]
    assert (rows[0] - rows[1]) / scale == pytest.approx(d[1, frame] - d[0, frame], abs=0.1)


def test_the_mark_is_as_long_as_the_ego(run, film):
    _, columns = marked(film, 5, EGO, 0)
    length = float(run.scenario.vehicles.length[0, 0]) + 2.0 * RING
    assert (columns.max() - columns.min() + 1) / film.view.scale == pytest.approx(length, abs=0.15)


def test_the_ego_has_its_colour_on_the_road(run, film):
    x, y = film.view.x(5, run.states.s[0, 0, 5] * MM), film.view.y(run.states.d[0, 0, 5] * MM)
    bonnet = film.draw(5).to_rgb()[SCENE_TOP + round(y), round(x + 1.7 * film.view.scale)]
    assert bonnet[0] > 2 * bonnet[1]  # Red.


def test_the_ego_is_above_the_lane_line_that_it_has_crossed():
    """To the left of travel is up: a sign that is easily flipped."""
    cars = [Vehicle(kind="M", s=100.0, lane=2), Vehicle(kind="M", s=100.0, lane=0)]
    film = Film(ot.simulate(scenario(cars, horizon=1.0)))
    assert film.view.y(float(film.scene.d[0, 0])) < film.view.y(float(film.scene.d[1, 0]))


def test_frames_are_the_same_every_time_and_in_any_order(run, film):
    again = Film(run, title="Simulation 0")
    drawn = [film.draw(frame).to_rgb() for frame in (3, 30, 12)]
    canvas = Canvas(WIDTH, HEIGHT, WARNING)
    for frame, picture in zip((12, 30, 3), drawn[::-1], strict=True):
        assert np.array_equal(again.draw(frame, canvas).to_rgb(), picture)
    assert drawn[0].shape == (HEIGHT, WIDTH, 3)


@pytest.mark.parametrize("frame", [-1, 41])
def test_a_frame_that_is_not_there_is_refused(film, frame):
    with pytest.raises(IndexError, match=f"expected 0 to 40, got {frame}"):
        film.draw(frame)


def test_ego_and_target_stay_in_the_picture_while_both_fit():
    cars = [Vehicle(kind="M", s=100.0, lane=1, speed=25.0), Vehicle(kind="M", s=170.0, lane=1)]
    film = Film(ot.simulate(scenario(cars, horizon=3.0)))
    for frame in range(film.num_frames):
        for index in (0, 1):
            assert 0 < film.view.x(frame, float(film.scene.s[index, frame])) < WIDTH


def test_the_whole_width_of_any_road_is_in_the_picture():
    for lanes in (1, 3, 5, 8):
        road = wide_road(lanes=lanes, width=4.5)
        film = Film(ot.simulate(scenario([Vehicle(s=100.0)], road=road, horizon=0.5)))
        for border in road.lane_boundaries:
            assert 0 < film.view.y(border) < film.view.height


def test_real_time_is_kept_at_other_frame_intervals():
    cars = [Vehicle(s=100.0, lane=1)]
    for interval in (20, 50, 100, 250):
        shown = scene(ot.simulate(scenario(cars, horizon=2.0, frame_interval_ms=interval)))
        assert shown.num_frames == 41
        assert np.abs(shown.time - np.arange(41) * 0.05).max() <= interval / 2000.0 + 1e-9


def test_the_distance_to_the_target_is_that_of_the_bumpers(run, film):
    s, length = run.states.s[0].astype(float) * MM, run.scenario.vehicles.length[0].astype(float)
    gap = s[1] - s[0] - 0.5 * (length[0] + length[1])
    assert film.scene.lead == pytest.approx(gap, abs=1e-6)


def test_a_target_that_was_passed_is_behind():
    cars = [Vehicle(kind="M", s=120.0, lane=2, speed=30.0), Vehicle(kind="M", s=112.0, lane=1)]
    run = ot.simulate(scenario(cars, horizon=1.0))
    behind = dataclasses.replace(scene(run), target=1).lead
    assert behind is not None
    lengths = run.scenario.vehicles.length[0, :2].astype(float)
    assert behind[0] == pytest.approx(-(8.0 - 0.5 * lengths.sum()), abs=1e-3)


def test_the_cursor_moves_from_the_first_to_the_last_column(film):
    timeline = Timeline(film.scene, [], film.num_frames)
    columns = [timeline.column(frame) for frame in range(film.num_frames)]
    assert (columns[0], columns[-1]) == (80, 1096)
    assert columns == sorted(columns)
    strip = film.draw(20).to_rgb()[SCENE_BOTTOM + 12, :, 0]
    assert strip[columns[20]] > 200  # The cursor is the brightest thing there.


def with_lights(run, lights: int):
    states = run.states
    return run.replace(states=states.replace(lights=np.full_like(states.lights, lights)))


def test_an_indicator_blinks_sixty_to_one_hundred_and_twenty_times_a_minute(run):
    """UN Regulation 6 asks for 90 +- 30."""
    film = Film(with_lights(run, int(Lights.INDICATOR_LEFT)))
    lit = film.traffic.lit[0, :40] > 0
    flashes = np.count_nonzero(np.diff(lit.astype(int)) == 1)
    assert 60 <= flashes / 2.0 * 60.0 <= 120


CAR = Body(kind=VehicleKind.MEDIUM_CAR, colour=Colour.GREY, length=4.6, width=1.8, height=1.5)


@pytest.mark.parametrize(
    ("light", "rows", "columns"),
    [
        (Lights.BRAKE, slice(None), "rear"),
        (Lights.INDICATOR_LEFT, "upper", slice(None)),
        (Lights.INDICATOR_RIGHT, "lower", slice(None)),
    ],
)
def test_a_lamp_shines_where_the_vehicle_has_it(light, rows, columns):
    drawing = lamps(CAR, int(light))
    black, white = (
        drawn(lambda canvas: canvas.draw_placed([(drawing, 640.0, 200.0, 0.0)], 10.0), grey)
        for grey in (0, 255)
    )
    light_there = 256.0 * (1.0 - (white - black) / 255.0)
    height, width = light_there.shape
    if columns == "rear":
        dark, bright = light_there[:, width // 2 :], light_there[:, : width // 2]
    else:
        dark, bright = light_there[height // 2 + 6 :], light_there[: height // 2 - 6]
        if rows == "lower":
            dark, bright = bright, dark
    assert bright.max() > 200
    assert dark.max() < 20  # Of 256: its glow ends a little beyond the middle.


def test_a_recording_that_does_not_know_its_lamps_shows_none(run):
    dark = with_lights(run, int(Lights.BRAKE)).replace(unknown=frozenset({"lamps"}))
    assert not scene(dark).lights.any()


def test_a_recording_that_does_not_know_stage_and_weather_can_be_filmed(run):
    film = Film(run.replace(unknown=frozenset({"stage", "weather", "percepts"})))
    assert film.scene.stage is None
    assert not near(film.draw(0).to_rgb()[8:32, 420:900], STAGES[Stage.FOLLOW][1]).any()


def test_a_vehicle_that_was_not_recorded_in_a_frame_is_not_shown(run):
    present = np.ones(run.states.s.shape, bool)
    present[0, 1, :10] = False
    film = Film(run.replace(is_recorded=present))
    assert np.flatnonzero(film.traffic.seen[:, 5]).tolist() == [0, 2]
    assert np.flatnonzero(film.traffic.seen[:, 20]).tolist() == [0, 1, 2]


def findings(first: int, last: int, *codes: str) -> Findings:
    rules = codes or ("L3",)

    def array(value, kind):
        return np.full((1, len(rules)), value, kind)

    return Findings(
        rule_codes=rules,
        version="test",
        verdict=array(1, np.uint8),
        margin=array(-1.0, np.float32),
        first_frame=array(first, np.int32),
        last_frame=array(last, np.int32),
        longest_run=array(last - first + 1, np.int32),
        severity=array(2, np.uint8),
        belief=array(0, np.uint8),
    )


def red(film: Film, frame: int) -> int:
    corner = film.draw(frame).to_rgb()[SCENE_BOTTOM - 30 : SCENE_BOTTOM, :300]
    return int(near(corner, WARNING).sum())


def test_a_breach_is_told_from_its_first_to_its_last_frame(run):
    film = Film(run, findings=findings(10, 20))
    assert [red(film, frame) > 500 for frame in (9, 10, 20, 21)] == [False, True, True, False]


def test_a_breach_that_the_policy_does_not_count_is_grey_and_says_so(run):
    """A film of a lawful overtake shows no red article."""
    film = Film(run, findings=findings(10, 20, "L20"), policy=stored_policy("paper"))
    picture = film.draw(15).to_rgb()
    assert red(film, 15) == 0
    assert not near(picture[SCENE_BOTTOM:], WARNING, 12).any()
    assert near(picture[SCENE_BOTTOM - 30 : SCENE_BOTTOM, :300], ASIDE, 12).sum() > 500
    (note,) = breaches(film.scene, findings(10, 20, "L20"), stored_policy("paper"))
    assert note.text == "Article 74: Lanes for trucks (serious) - not counted by policy paper"
    (note,) = breaches(film.scene, findings(10, 20, "L20"), stored_policy("default"))
    assert note.text == "Article 74: Lanes for trucks (serious)"


def test_what_counts_is_shown_first(run):
    both = findings(10, 20, "L20", "L3")
    notes = breaches(scene(run), both, stored_policy("paper"))
    assert [note.counts for note in notes] == [True, False]


def test_a_class_is_explained_beside_its_name_in_the_room_that_there_is():
    for label in OvertakeClass:
        for each in STORED_POLICIES:
            text = explained(label.title, each.name)
            assert each.name in text
            assert 16 + lettering(text, 11).shape[1] < 420  # Left of where the stages begin.


def test_of_two_readings_of_a_rule_only_the_required_one_is_shown():
    default, strict = (articles_of(stored_policy(name)).keys() for name in ("default", "strict"))
    assert {"L14", "L15"} <= default
    assert not {"L14s", "L15s"} & default
    assert {"L14s", "L15s"} <= strict
    assert not {"L14", "L15"} & strict


def test_breaches_by_others_are_not_shown():
    theirs = {rule.code for rule in PORTUGAL.rules if not rule.is_duty_of_ego}
    assert theirs
    for each in STORED_POLICIES:
        assert not theirs & articles_of(each).keys()


def test_values_of_one_axis_stay_clear_of_those_of_the_other(film):
    """Rows of the labels left of the plots: two of speeds, two of distances, none touching."""
    labels = film.draw(20).to_rgb()[SCENE_BOTTOM:HEIGHT, :78]
    is_written = (labels > 80).any(axis=(1, 2))
    tops = np.flatnonzero(np.diff(is_written.astype(int), prepend=0) == 1)
    assert len(tops) == 4
    assert np.diff(tops).min() >= 16


def test_a_collision_flashes_where_the_two_touch_and_is_told_from_then_on():
    cars = [Vehicle(kind="M", s=100.0, lane=1, speed=30.0, driver={"reaction_time": 10.0})]
    cars.append(Vehicle(kind="M", s=106.0, lane=1, speed=5.0))
    film = Film(ot.simulate(scenario(cars, horizon=3.0)))
    assert film.contact is not None
    first, s, _ = film.contact
    rear = film.scene.s[1, first] - 0.5 * film.scene.bodies[1].length
    assert s == pytest.approx(rear, abs=1.0)  # They moved on until the frame was taken.
    assert [red(film, frame) > 500 for frame in (first - 1, first, film.num_frames - 1)] == [
        False,
        True,
        True,
    ]


def test_an_ego_that_leaves_the_lanes_is_told(run):
    states = run.states.replace(d=run.states.d.copy())
    states.d[0, 0, 25:] = -30_000
    film = Film(run.replace(states=states))
    assert [red(film, frame) > 500 for frame in (24, 25)] == [False, True]


def test_a_film_of_nobody_but_the_ego_is_a_film():
    film = Film(ot.simulate(scenario([Vehicle(s=100.0)], horizon=0.5)))
    assert film.scene.target is None
    assert film.draw(3).to_rgb().any()


def test_a_recording_of_one_frame_is_a_film_of_one_frame(run):
    film = Film(run.replace(num_frames=np.array([1], np.int32)))
    assert film.num_frames == 1
    assert film.draw(0).to_rgb().any()


def test_two_simulations_at_once_are_refused_in_one_line(run):
    both = ot.simulate(scenario([Vehicle(s=100.0)], [Vehicle(s=100.0)], horizon=0.5))
    with pytest.raises(ConfigError, match=r"a batch of one, got 2; select one") as caught:
        Film(both)
    assert "\n" not in str(caught.value)


def test_the_view_moves_by_whole_pixels_of_chroma(film):
    assert (view(film.scene).left % 2 == 0).all()


def test_names_at_the_edge_do_not_cover_each_other():
    cars = [Vehicle(kind="M", s=s, lane=2, speed=25.0) for s in (100.0, 130.0)]
    alone = Film(ot.simulate(scenario(cars)))
    edge = (int(alone.view.left[0]) + WIDTH) / alone.view.scale
    cars += [Vehicle(kind="M", s=edge + more, lane=2, speed=25.0) for more in (6.0, 22.0)]
    before, after = (
        film.draw(0).to_rgb()[SCENE_TOP:SCENE_BOTTOM, WIDTH - 80 :]
        for film in (alone, Film(ot.simulate(scenario(cars))))
    )
    height = 18  # Of a name; two of them must be seen whole.
    assert int((before != after).any(axis=(1, 2)).sum()) >= 2 * height
