"""The picture of the camera: what is in it where, and that it says what it is."""

from __future__ import annotations

import math

import numpy as np
import pytest

from overtaking._core import Canvas, Drawing
from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.simulators.carla_server.arguments import Rotation, Transform, Vector
from overtaking.simulators.carla_server.camera import NOTE, RoadScene, air_of, dots, stamp
from overtaking.simulators.carla_server.maps import known_map
from overtaking.simulators.carla_server.raster import Lens, project

MAP = known_map("town06")


def weather(name: str) -> tuple[float, ...]:
    return tuple(weather_presets()[name].carla_fields().values())


def looking(x: float, y: float, z: float, pitch: float = 0.0, yaw: float = 0.0) -> Transform:
    return Transform(Vector(x, y, z), Rotation(pitch, yaw, 0.0))


def test_a_point_ahead_is_in_the_middle_and_one_to_the_right_is_right_of_it():
    lens = Lens.of(looking(0.0, 0.0, 1.0), (200, 100), 90.0)
    far = np.array([(100.0, 0.0, 1.0), (100.0, 50.0, 1.0), (100.0, 0.0, 26.0)])
    found = project(lens, far)
    assert found is not None
    # With 90 degrees of view the focal length is half the width.
    assert found == pytest.approx(np.array([(100.0, 50.0), (150.0, 50.0), (100.0, 25.0)]))


def test_what_lies_behind_is_not_seen_and_what_passes_the_camera_is_cut():
    lens = Lens.of(looking(0.0, 0.0, 1.0), (200, 100), 90.0)
    behind = np.array([(-5.0, 0.0, 0.0), (-5.0, 1.0, 0.0), (-6.0, 0.0, 0.0)])
    assert project(lens, behind) is None
    passing = np.array([(-5.0, -1.0, 0.0), (20.0, -1.0, 0.0), (20.0, 1.0, 0.0), (-5.0, 1.0, 0.0)])
    found = project(lens, passing)
    assert found is not None
    assert np.isfinite(found).all()


def picture(pose: Transform, name: str = "ClearNoon") -> np.ndarray:
    return RoadScene(MAP).draw(pose, (320, 180), 90.0, (), weather(name))


def test_every_picture_says_that_it_is_not_unreal():
    image = picture(looking(300.0, 244.65, 2.0))
    written = dots(NOTE)
    rows, columns = written.shape
    corner = image[-rows - 2 : -2, 2 : columns + 2, :3]
    assert (corner[written] == 255).all()
    assert (corner[~written] < 130).all()


def test_the_note_fits_in_a_picture_of_a_few_pixels():
    canvas, drawing = Canvas(10, 4, "#ffffff"), Drawing()
    stamp(drawing, (10, 4), NOTE)
    canvas.draw(drawing)
    assert canvas.to_rgb().min() < 128


def test_night_is_darker_than_day_and_fog_hides_the_road_far_ahead():
    pose = looking(300.0, 244.65, 2.0)
    day, night = picture(pose).mean(), picture(pose, "ClearNight").mean()
    assert night < 0.6 * day
    clear, foggy = (air_of(weather(name)).haze for name in ("ClearNoon", "HardRainNight"))
    # CARLA's fog of 100 leaves 1/e of the contrast at 50 m.
    assert math.exp(-50.0 * foggy) < 0.4 < math.exp(-50.0 * clear)


def test_all_presets_give_a_picture_from_above_and_below_and_backwards():
    for name in weather_presets():
        for pose in (looking(300.0, 244.0, 60.0, -90.0), looking(300.0, 244.0, 2.0, 89.0, 180.0)):
            image = picture(pose, name)
            assert image.shape == (180, 320, 4)
            assert (image[:, :, 3] == 255).all()


def test_lines_are_seen_from_above_where_the_map_has_them():
    image = picture(looking(300.0, 244.65, 20.0, -90.0))
    row = image[90, :, :3].astype(int).min(axis=1)
    white = np.flatnonzero(row > 160)  # A line is 1.2 pixels wide, its edges are smooth.
    # 20 m up with 90 degrees of view, 40 m of road fill 320 pixels: 8 pixels a metre. The solid
    # edges are 8.75 m from the middle of the third lane.
    assert abs(white.min() - (160 - 70)) <= 2
    assert abs(white.max() - (160 + 70)) <= 2
