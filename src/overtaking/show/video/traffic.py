"""The vehicles of a film: bodies, lamps and their light on the road, rings and names."""

import math
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.units import kmh_from_mps
from overtaking.model.trajectories import Lights
from overtaking.model.vehicles import EGO_SLOT
from overtaking.show.video import palette, sky
from overtaking.show.video.canvas import WIDTH, Canvas, Drawing
from overtaking.show.video.scene import FilmScene
from overtaking.show.video.sky import Light
from overtaking.show.video.text import Picture, lettering
from overtaking.show.video.vehicles import lamps, mark, painted
from overtaking.show.video.view import SCENE_BOTTOM, SCENE_TOP, Camera

if TYPE_CHECKING:
    from overtaking.core.arrays import F64

Bools = NDArray[np.bool_]

_BLINK = 14  # Frames from one flash of an indicator to the next: 86 a minute (UN R6: 60 to 120).
_INDICATORS = np.uint8(Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT)
_BEAMS = Lights.LOW_BEAM | Lights.HIGH_BEAM
_MARGIN = 30.0  # Vehicles farther outside the picture are not shown [m].
_OTHER = 2
_AWAY_STEP = 5.0  # A distance that changed with every frame could not be read [m].
_TAG_HEIGHT = 18
_TAG_PITCH = 20
_TAG_GAP = 8.0


class OnScreen(NamedTuple):
    """Where a vehicle is in a frame.

    Attributes:
        vehicle: Which vehicle of the scene.
        x: Column of its middle [px].
        y: Row of its middle [px].
        angle: Anticlockwise [rad].
    """

    vehicle: int
    x: float
    y: float
    angle: float


class Traffic:
    """Where vehicles are seen.

    Attributes:
        seen: Whether a vehicle may be in the picture; all arrays have shape (vehicle, frame).
        x: Column of its middle [px].
        y: Row of its middle [px].
        lit: `Lights` bits as they look: indicators are dark half of the time.

    Args:
        scene: The vehicles.
        camera: Where they are on the screen.
        shade: Shadow of the vehicles, as in `Sky`.
        spray: 0 none to 1.
    """

    def __init__(
        self, scene: FilmScene, camera: Camera, shade: tuple[float, float, float], spray: float
    ) -> None:
        """Work out the places of all vehicles in all frames."""
        self._scene, self._scale = scene, camera.scale
        self.x: F64 = scene.s * camera.scale - camera.left
        self.y: F64 = SCENE_TOP + camera.y(scene.d)
        margin = _MARGIN * camera.scale
        self.seen: Bools = scene.is_there & (-margin < self.x) & (self.x < WIDTH + margin)
        is_dark = np.arange(scene.num_frames) % _BLINK >= _BLINK // 2
        self.lit = np.where(is_dark, scene.lights & ~_INDICATORS, scene.lights)
        self._bodies = [painted(body, shade, spray) for body in scene.bodies]

    def at(self, frame: int) -> list[OnScreen]:
        """The vehicles that are seen in a frame: others first, so that ego and target lie above."""
        seen = np.flatnonzero(self.seen[:, frame])
        columns = (seen, *(one[seen, frame] for one in (self.x, self.y, self._scene.angle)))
        places = [OnScreen(*one) for one in zip(*(each.tolist() for each in columns), strict=True)]
        return sorted(places, key=lambda one: -self._rank(one.vehicle))

    def draw_bodies(self, canvas: Canvas, places: list[OnScreen]) -> None:
        """Draw bodies with their shadows and the spray behind them."""
        canvas.draw_placed([(self._bodies[one.vehicle], *one[1:]) for one in places], self._scale)

    def draw_lamps(self, canvas: Canvas, places: list[OnScreen], frame: int) -> None:
        """Draw the lamps that are lit."""
        lit = [int(self.lit[one.vehicle, frame]) for one in places]
        bodies = self._scene.bodies
        shown = [
            (lamps(bodies[one.vehicle], lights), *one[1:])
            for one, lights in zip(places, lit, strict=True)
            if lights
        ]
        canvas.draw_placed(shown, self._scale)

    def lights(self, places: list[OnScreen], frame: int) -> list[tuple[Light, float, float]]:
        """Headlamps that light the road, and a little light around every vehicle."""
        glimmer, shining = sky.glimmer(self._scale), list[tuple[sky.Light, float, float]]()
        for index, x, y, angle in places:
            shining.append((glimmer, x, y))
            lit = int(self.lit[index, frame])
            if lit & _BEAMS:
                is_high = bool(lit & Lights.HIGH_BEAM)
                beam = sky.beam(round(math.degrees(angle)), self._scale, is_high=is_high)
                front = 0.5 * self._scene.bodies[index].length * self._scale
                ahead = x + front * math.cos(angle), y - front * math.sin(angle)
                shining.append((beam, *ahead))
        return shining

    def draw_marks(self, canvas: Canvas, places: list[OnScreen], frame: int) -> None:
        """Draw rings and names."""
        away: dict[bool, list[int]] = {}
        for place in places:
            index, x, y, angle = place
            if self._rank(index) < _OTHER:
                ring = mark(self._scene.bodies[index], self._scale, is_ego=index == EGO_SLOT)
                canvas.draw_placed([(ring, x, y, angle)], self._scale)
            self._draw_name(canvas, place, frame, away)

    def _rank(self, index: int) -> int:
        """0 for the ego, 1 for the target, 2 for the others."""
        if index == EGO_SLOT:
            return 0
        return 1 if index == self._scene.target else _OTHER

    def _draw_name(
        self, canvas: Canvas, place: OnScreen, frame: int, away: dict[bool, list[int]]
    ) -> None:
        """Draw the name of a vehicle beside it, or at the edge of the picture that it has left by.

        Names at an edge lie below each other: `away` holds the rows that are taken, by whether the
        left edge is meant.
        """
        index, x, y, _ = place
        rank, half = self._rank(index), 0.5 * self._scene.bodies[index].width * self._scale
        name = self._name(place, frame)
        lowest = SCENE_BOTTOM - _TAG_HEIGHT - 2
        wished = y + half + _TAG_GAP if rank == 1 else y - half - _TAG_GAP - _TAG_HEIGHT
        row = round(min(max(wished, SCENE_TOP + 2), lowest))
        column = round(min(max(x - 0.5 * name.width, 4), WIDTH - name.width - 4))
        if not 0.0 <= x < WIDTH:
            row = _free(away.setdefault(x < 0.0, []), row, lowest)
        canvas.draw(name.drawing, column, row)

    def _name(self, place: OnScreen, frame: int) -> Picture:
        """Text beside a vehicle."""
        scene, index, rank = self._scene, place.vehicle, self._rank(place.vehicle)
        name = ("EGO", "TARGET", str(scene.slots[index]))[rank]
        if 0.0 <= place.x < WIDTH:
            speed = kmh_from_mps(float(scene.speed[index, frame]))
            return tag(f"{name} {speed:.0f}" if rank < _OTHER else name, rank)
        metres = abs(float(scene.s[index, frame] - scene.s[EGO_SLOT, frame]))
        away = f"{name}: {_AWAY_STEP * round(metres / _AWAY_STEP):.0f} m"
        return tag(f"< {away}" if place.x < 0.0 else f"{away} >", rank)


def _free(taken: list[int], row: int, last: int) -> int:
    """The row nearest to a wished one in which no other name lies, and take it."""

    def is_free(one: int) -> bool:
        return all(abs(one - other) >= _TAG_PITCH for other in taken)

    if not is_free(row):
        rows = sorted(range(SCENE_TOP + 2, last, 2), key=lambda one: abs(one - row))
        row = next(filter(is_free, rows), row)
    taken.append(row)
    return row


@lru_cache(maxsize=1024)
def tag(text: str, rank: int) -> Picture:
    """The name of a vehicle: filled for the ego, framed for the target, small for the others."""
    ink = (palette.INK, palette.TARGET, palette.TEXT)[rank]
    letters = lettering(text, 12 if rank < _OTHER else 11, bold=rank < _OTHER)
    width, drawing = letters.shape[1] + 12, Drawing()
    box = (0.0, float(width)), (0.0, float(_TAG_HEIGHT))
    if rank == 0:
        drawing.rect(*box, palette.EGO, radius=4.0)
    else:
        drawing.rect(*box, palette.INK, opacity=0.85 if rank == 1 else 0.45, radius=4.0)
    if rank == 1:
        drawing.outline(*box, palette.TARGET, line=1.5, radius=4.0)
    drawing.mask(letters, (6, (_TAG_HEIGHT - letters.shape[0]) // 2 + 1), ink)
    return Picture(drawing, width, _TAG_HEIGHT)
