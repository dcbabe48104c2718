"""The vehicles of a film: bodies, lamps and their light on the road, rings and names."""

from __future__ import annotations

from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from overtaking.core.units import kmh_from_mps
from overtaking.model.trajectory import Lights
from overtaking.model.vehicles import Role
from overtaking.video import palette, sky
from overtaking.video.canvas import WIDTH
from overtaking.video.sheet import Sheet
from overtaking.video.text import lettering
from overtaking.video.vehicles import lamps, mark, painted

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.video.display import Part
    from overtaking.video.pictures import Sprite
    from overtaking.video.scene import F64, Scene
    from overtaking.video.view import View

    Bools = NDArray[np.bool_]

_BLINK = 14  # Frames from one flash of an indicator to the next: 86 a minute (UN R6: 60 to 120).
_INDICATORS = np.uint8(Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT)
_BEAMS = np.uint8(Lights.LOW_BEAM | Lights.HIGH_BEAM)
_MARGIN = 30.0  # Vehicles that are farther outside the picture are not told of [m].
_OTHER = 2
_AWAY_STEP = 5.0  # A distance that changed with every frame could not be read [m].
_TAG_HEIGHT = 18
_TAG_PITCH = 20
_TAG_GAP = 8.0


class Traffic:
    """Where vehicles are seen.

    Attributes:
        seen: Whether a vehicle may be in the picture; all arrays have shape (vehicle, frame).
        x: Column of its middle [px].
        y: Row, from the top of the picture of the road [px].
        lit: `Lights` bits as they look: indicators are dark half of the time.

    Args:
        scene: The vehicles.
        view: Where they are on the screen.
    """

    def __init__(self, scene: Scene, view: View) -> None:
        """Work out the places of all vehicles in all frames."""
        self._scene, self._scale = scene, view.scale
        self.x: F64 = scene.s * view.scale - view.left
        self.y: F64 = view.y(scene.d)
        margin = _MARGIN * view.scale
        self.seen: Bools = scene.is_there & (-margin < self.x) & (self.x < WIDTH + margin)
        is_dark = np.arange(scene.num_frames) % _BLINK >= _BLINK // 2
        self.lit = np.where(is_dark, scene.lights & ~_INDICATORS, scene.lights)

    def lay_bodies(self, part: Part, shade: tuple[float, float, float], spray: float) -> None:
        """Put bodies on the road, with their shadows and the spray behind them."""
        for index, body in enumerate(self._scene.bodies):
            frames = np.flatnonzero(self.seen[index])
            if len(frames):
                texture = painted(body, self._scale, shade, spray)
                part.texture(texture, *self._places(index, frames), frames=frames)

    def lay_lamps(self, part: Part) -> None:
        """Put the lamps that are lit on all bodies."""
        for index, body in enumerate(self._scene.bodies):
            for lights in np.unique(self.lit[index]):
                frames = np.flatnonzero(self.seen[index] & (self.lit[index] == lights))
                if lights and len(frames):
                    texture = lamps(body, int(lights), self._scale)
                    part.texture(texture, *self._places(index, frames), frames=frames)

    def illuminate(self, part: Part) -> None:
        """Let headlamps shine into the night, and a little light around every vehicle."""
        glimmer = sky.glimmer(self._scale)
        for index in range(len(self._scene.bodies)):
            frames = np.flatnonzero(self.seen[index])
            part.light(glimmer, self.x[index, frames], self.y[index, frames], frames=frames)
            self._beams(part, index)

    def _beams(self, part: Part, index: int) -> None:
        """The light of the headlamps of a vehicle."""
        scene = self._scene
        is_lit = self.seen[index] & (scene.lights[index] & _BEAMS > 0)
        is_high = scene.lights[index] & np.uint8(Lights.HIGH_BEAM) > 0
        degrees = np.rint(np.degrees(scene.angle[index]))
        front = 0.5 * scene.bodies[index].length * self._scale
        for turn, high in product(np.unique(degrees[is_lit]), (False, True)):
            frames = np.flatnonzero(is_lit & (degrees == turn) & (is_high == high))
            if not len(frames):
                continue
            x, y, angle = self._places(index, frames)
            beam = sky.beam(int(turn), self._scale, is_high=high)
            ahead = (x + front * np.cos(angle), y - front * np.sin(angle))
            part.light(beam, *ahead, frames=frames)

    def _places(self, index: int, frames: NDArray[np.intp]) -> tuple[F64, F64, F64]:
        """Column, row and angle of a vehicle."""
        return self.x[index, frames], self.y[index, frames], self._scene.angle[index, frames]

    def lay_marks(self, part: Part) -> None:
        """Put rings and names: the others first, so that ego and target lie above them."""
        away: dict[tuple[int, bool], list[int]] = {}
        for index in sorted(range(len(self._scene.bodies)), key=lambda one: -self._rank(one)):
            rank, body = self._rank(index), self._scene.bodies[index]
            frames = np.flatnonzero(self.seen[index])
            if rank < _OTHER and len(frames):
                ring = mark(body.length, body.width, self._scale, is_ego=rank == 0)
                part.texture(ring, *self._places(index, frames), frames=frames)
            self._lay_names(part, index, frames, away)

    def _rank(self, index: int) -> int:
        """0 for the ego, 1 for the target, 2 for the others."""
        if index == Role.EGO:
            return 0
        return 1 if index == self._scene.target else _OTHER

    def _lay_names(
        self,
        part: Part,
        index: int,
        frames: NDArray[np.intp],
        away: dict[tuple[int, bool], list[int]],
    ) -> None:
        """Put the name of a vehicle beside it, or at the edge of the picture that it has left by.

        Names at an edge lie below each other: `away` holds the rows that are taken, by frame and
        by whether the left edge is meant.
        """
        tags, which = self._tags(index, frames)
        x, y = self.x[index, frames], self.y[index, frames]
        rank, half = self._rank(index), 0.5 * self._scene.bodies[index].width * self._scale
        width = np.array([one.size[0] for one in tags], np.int64)[which]
        lowest = part.height - _TAG_HEIGHT
        wished = y + half + _TAG_GAP if rank == 1 else y - half - _TAG_GAP - _TAG_HEIGHT
        rows = (2 * np.rint(0.5 * np.clip(wished, 2.0, lowest - 2.0))).astype(int)
        columns = np.clip(2 * np.rint(0.5 * (x - 0.5 * width)), 4, WIDTH - width - 4)
        for place in np.flatnonzero((x < 0.0) | (x >= WIDTH)).tolist():
            taken = away.setdefault((int(frames[place]), bool(x[place] < 0.0)), [])
            rows[place] = _free(taken, int(rows[place]), lowest)
        part.sprites(tags, which, columns, rows, frames=frames)

    def _tags(self, index: int, frames: NDArray[np.intp]) -> tuple[list[Sprite], NDArray[np.intp]]:
        """What is written beside a vehicle, and which of it in each of some frames."""
        scene, rank, x = self._scene, self._rank(index), self.x[index, frames]
        name = ("EGO", "TARGET", str(scene.slots[index]))[rank]
        speeds = np.rint(kmh_from_mps(scene.speed[index, frames])) if rank < _OTHER else 0.0
        metres = np.abs(scene.s[index, frames] - scene.s[Role.EGO, frames])
        side = np.where(x < 0.0, 2, np.where(x < WIDTH, 0, 1))
        numbers = np.where(side == 0, speeds, _AWAY_STEP * np.rint(metres / _AWAY_STEP))
        kinds, which = np.unique(3 * numbers.astype(int) + side, return_inverse=True)
        here = f"{name} {{}}" if rank < _OTHER else name
        texts = (here, f"{name}: {{}} m >", f"< {name}: {{}} m")
        return [tag(texts[one % 3].format(one // 3), rank) for one in kinds.tolist()], which


def _free(taken: list[int], row: int, last: int) -> int:
    """The row nearest to a wished one in which no other name lies, and take it."""

    def is_free(one: int) -> bool:
        return all(abs(one - other) >= _TAG_PITCH for other in taken)

    if not is_free(row):
        rows = sorted(range(2, last, 2), key=lambda one: abs(one - row))
        row = next(filter(is_free, rows), row)
    taken.append(row)
    return row


@lru_cache(maxsize=1024)
def tag(text: str, rank: int) -> Sprite:
    """The name of a vehicle: filled for the ego, framed for the target, small for the others."""
    letters = lettering(text, 12 if rank < _OTHER else 11, bold=rank < _OTHER)
    width, height = float(letters.width + 12), float(_TAG_HEIGHT)
    sheet = Sheet((0.0, width, 0.0, height), 1.0)
    box = (0.0, width), (0.0, height)
    if rank == 0:
        sheet.rect(*box, palette.EGO, radius=4.0)
    else:
        sheet.rect(*box, palette.INK, opacity=0.85 if rank == 1 else 0.45, radius=4.0)
    if rank == 1:
        sheet.frame(*box, palette.TARGET, line=1.5, radius=4.0)
    ink = (palette.INK, palette.TARGET, palette.TEXT)[rank]
    sheet.write(letters, 6, (_TAG_HEIGHT - letters.height) // 2 + 1, ink)
    return sheet.sprite()
