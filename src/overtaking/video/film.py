"""A film of one simulation: a pure function from the number of a frame to its picture."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from overtaking.model.events import NEVER
from overtaking.model.labels import Severity, Verdict
from overtaking.model.trajectory import Lights, Stage
from overtaking.model.vehicles import Role
from overtaking.video import palette, sky
from overtaking.video.canvas import FRAME_SHAPE, WIDTH, Canvas
from overtaking.video.panel import Header, Timeline
from overtaking.video.road import strip
from overtaking.video.scene import RATE, scene
from overtaking.video.sheet import Sheet
from overtaking.video.text import lettering, line
from overtaking.video.vehicles import lamps, mark, painted
from overtaking.video.view import SCENE_BOTTOM, SCENE_TOP, view

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from overtaking.model.events import Events
    from overtaking.model.labels import Findings
    from overtaking.model.trajectory import Trajectories
    from overtaking.video.canvas import U8, Sprite
    from overtaking.video.scene import Scene
    from overtaking.video.texture import Texture

_BLINK = 14  # Frames from one flash of an indicator to the next: 86 a minute (UN R6: 60 to 120).
# Plain integers: operations on flags take as long as drawing a sprite.
_INDICATORS = int(Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT)
_HIGH_BEAM = int(Lights.HIGH_BEAM)
_BEAMS = int(Lights.LOW_BEAM) | _HIGH_BEAM
_FLASH_FRAMES = 14
_SIGN_EVERY = 100  # Metres between two distances beside the road.
_NOTE_GAP = 8
_NOTE_HEIGHT = 24
_TAG_HEIGHT = 18
_TAG_PITCH = 20
_MAX_NOTE_LETTERS = 110


class Film:
    """The frames of a film.

    Drawing depends on nothing but the simulation and the number of the frame: the same arrays every
    time, in any order.

    Args:
        run: A batch of one simulation.
        title: Its name in the film.
        events: What happened in it, if it is known.
        findings: What the rules say of it; what they find broken is shown as it happens.
        articles: For the codes of the rules that are told of, what shall be read; without it all
            rules by their codes.
        label: Class of the simulation.

    Raises:
        ConfigError: The batch holds another number of simulations than one.
    """

    def __init__(
        self,
        run: Trajectories,
        *,
        title: str = "Simulation",
        events: Events | None = None,
        findings: Findings | None = None,
        articles: Mapping[str, str] | None = None,
        label: str | None = None,
    ) -> None:
        """Prepare what does not change from frame to frame."""
        self.scene = scene(run, events)
        self.view = view(self.scene)
        self._sky = sky.sky(run)
        self._contact = _contact(self.scene)
        notes = _breaches(self.scene, findings, articles)
        subtitle = " · ".join([run.scenario.profile, *([label] if label else [])])
        self._header = Header(title, subtitle, self._sky.text)
        self._timeline = Timeline(self.scene, [(first, last) for first, last, _ in notes])
        self._notes = [*self._endings(), *notes]
        scale = self.view.scale
        self._strip = strip(run.road, scale, self.view.middle_d, self._sky.tone)
        self._fog, self._glare = sky.fog(self._sky, scale), sky.glare(self._sky)
        self._night = sky.Night(scale, self.view.height) if self._sky.is_night else None
        rate, height = self._sky.rate, self.view.height
        self._rain = sky.rain(rate, height, is_night=self._sky.is_night) if rate > 0.0 else ()
        self._bodies = [
            painted(body, scale, self._sky.shade, self._sky.spray) for body in self.scene.bodies
        ]
        self._lamps: dict[tuple[int, int], Texture] = {}

    @property
    def num_frames(self) -> int:
        """Number of frames, `RATE` of them a second."""
        return self.scene.num_frames

    def draw(self, frame: int, out: U8 | None = None) -> U8:
        """Draw a frame.

        Args:
            frame: Its number, 0 <= frame < num_frames.
            out: Where to draw, of `FRAME_SHAPE`; made if missing.

        Returns:
            The frame in YUV 4:2:0, of `FRAME_SHAPE`; `canvas.rgb` converts it.
        """
        picture = np.empty(FRAME_SHAPE, dtype=np.uint8) if out is None else out
        staged = self.scene.stage
        stage = None if staged is None else Stage(int(staged[frame]))
        self._header.lay(Canvas(picture, 0, SCENE_TOP), stage)
        self._road(Canvas(picture, SCENE_TOP, SCENE_BOTTOM), frame)
        self._timeline.lay(Canvas(picture, SCENE_BOTTOM), frame)
        return picture

    def _road(self, canvas: Canvas, frame: int) -> None:
        """The part of the picture with the road."""
        self._strip.lay(canvas, int(self.view.left[frame]))
        seen = list(self._seen(frame))
        for index, x, y, angle in seen:
            canvas.blend(*self._bodies[index].at(x, y, angle))
        self._hide(canvas, frame, seen)
        for index, x, y, angle in seen:
            self._lamp(canvas, frame, index, (x, y, angle))
        if self._rain:
            streaks = self._rain[(2 * frame) % len(self._rain)]
            np.maximum(canvas.luma, streaks, out=canvas.luma)
        self._signs(canvas, frame)
        self._marks(canvas, frame, seen)
        self._flash(canvas, frame)
        self._tell(canvas, frame)

    def _seen(self, frame: int) -> Iterator[tuple[int, float, float, float]]:
        """Vehicles that may be in the picture: index, column, row, angle."""
        scene, margin = self.scene, 30.0 * self.view.scale
        for index in np.flatnonzero(scene.is_there[:, frame]).tolist():
            x = self.view.x(frame, float(scene.s[index, frame]))
            if -margin < x < WIDTH + margin:
                y = self.view.y(float(scene.d[index, frame]))
                yield index, x, y, float(scene.angle[index, frame])

    def _lights(self, index: int, frame: int) -> int:
        """Lights of a vehicle as they look in a frame: indicators are dark half of the time."""
        lights = int(self.scene.lights[index, frame])
        return lights if frame % _BLINK < _BLINK // 2 else lights & ~_INDICATORS

    def _lamp(
        self, canvas: Canvas, frame: int, index: int, place: tuple[float, float, float]
    ) -> None:
        lights = self._lights(index, frame)
        if not lights:
            return
        key = (index, lights)
        if key not in self._lamps:
            self._lamps[key] = lamps(self.scene.bodies[index], lights, self.view.scale)
        canvas.blend(*self._lamps[key].at(*place))

    def _hide(
        self, canvas: Canvas, frame: int, seen: Sequence[tuple[int, float, float, float]]
    ) -> None:
        """Night, low sun and fog; lamps are drawn later, as they are seen through all of them."""
        ego = self.view.x(frame, float(self.scene.s[Role.EGO, frame]))
        first = min(max(WIDTH - 2 * round(0.5 * ego), 0), WIDTH)
        if self._glare is not None:
            self._glare.lay(canvas)
        if self._night is not None:
            self._illuminate(frame, seen, self._night)
            self._night.lay(canvas, self._fog, first)
        elif self._fog is not None:
            self._fog.lay(canvas, first)

    def _illuminate(
        self,
        frame: int,
        seen: Sequence[tuple[int, float, float, float]],
        night: sky.Night,
    ) -> None:
        """The light of everybody's headlamps."""
        night.fall()
        for index, x, y, angle in seen:
            night.glimmer(x, y)
            lights = int(self.scene.lights[index, frame])
            if lights & _BEAMS:
                front = 0.5 * self.scene.bodies[index].length * self.view.scale
                ahead = (x + front * math.cos(angle), y - front * math.sin(angle))
                night.shine(*ahead, angle, is_high=bool(lights & _HIGH_BEAM))

    def _signs(self, canvas: Canvas, frame: int) -> None:
        """Distances along the road, at the upper edge."""
        left = int(self.view.left[frame]) / self.view.scale
        first = math.ceil(left / _SIGN_EVERY) * _SIGN_EVERY
        for s in range(first, int(left + WIDTH / self.view.scale) + 1, _SIGN_EVERY):
            text = line(f"{s} m", 11, "#e4e8e6")
            column = round(0.5 * self.view.x(frame, s)) * 2
            canvas.blend(text, column - text.size[0] // 4 * 2, 2)

    def _marks(
        self,
        canvas: Canvas,
        frame: int,
        seen: Sequence[tuple[int, float, float, float]],
    ) -> None:
        """Rings and names: the others first, so that ego and target lie above them."""
        order = sorted(seen, key=lambda one: -self._rank(one[0]))
        away: list[tuple[bool, int]] = []
        for index, x, y, angle in order:
            rank, body = self._rank(index), self.scene.bodies[index]
            if rank < _OTHER:
                ring = mark(body.length, body.width, self.view.scale, is_ego=rank == 0)
                canvas.blend(*ring.at(x, y, angle))
            self._name(canvas, frame, index, (x, y), away)

    def _rank(self, index: int) -> int:
        """0 for the ego, 1 for the target, 2 for the others."""
        if index == Role.EGO:
            return 0
        return 1 if index == self.scene.target else _OTHER

    def _name(
        self,
        canvas: Canvas,
        frame: int,
        index: int,
        place: tuple[float, float],
        away: list[tuple[bool, int]],
    ) -> None:
        """The name of a vehicle beside it, or at the edge of the picture that it has left by.

        Names at an edge lie below each other: `away` holds on which side and in which row.
        """
        rank = self._rank(index)
        text = ("EGO", "TARGET", str(self.scene.slots[index]))[rank]
        body = self.scene.bodies[index]
        if not 0.0 <= place[0] < WIDTH:
            metres = abs(self.scene.s[index, frame] - self.scene.s[Role.EGO, frame])
            far = f"{text}: {_AWAY_STEP * round(metres / _AWAY_STEP):.0f} m"
            text = f"< {far}" if place[0] < 0.0 else f"{far} >"
        elif rank < _OTHER:
            text = f"{text} {3.6 * self.scene.speed[index, frame]:.0f}"
        sprite = tag(text, rank)
        width, height = sprite.size
        apart = 0.5 * body.width * self.view.scale + 8.0
        row = place[1] + apart if rank == 1 else place[1] - apart - height
        column = min(max(2 * round(0.5 * (place[0] - 0.5 * width)), 4), WIDTH - width - 4)
        row = 2 * round(0.5 * min(max(row, 2.0), canvas.height - height - 2.0))
        if not 0.0 <= place[0] < WIDTH:
            row = _free(away, place[0] < 0.0, row, canvas.height - height)
        canvas.blend(sprite, column, row)

    def _flash(self, canvas: Canvas, frame: int) -> None:
        """The flash of a collision, which fades."""
        if self._contact is None:
            return
        first, s, d = self._contact
        age = frame - first
        if 0 <= age < _FLASH_FRAMES:
            burst = _burst(age, self.view.scale)
            canvas.blend(*burst.at(self.view.x(frame, s), self.view.y(d), 0.0))

    def _tell(self, canvas: Canvas, frame: int) -> None:
        """What is being broken, and the collision: on the verge as long as there is room."""
        column, row = _NOTE_GAP, canvas.height - _NOTE_HEIGHT - 2
        for first, last, sprite in self._notes:
            if not first <= frame <= last:
                continue
            if column + sprite.size[0] > WIDTH and column > _NOTE_GAP:
                column, row = _NOTE_GAP, row - _NOTE_HEIGHT - 2
            canvas.blend(sprite, column, row)
            column += sprite.size[0] + _NOTE_GAP

    def _endings(self) -> Iterator[tuple[int, int, Sprite]]:
        """Notes of how a film ends badly, from the frame on in which it is so."""
        scene, last = self.scene, self.scene.num_frames - 1
        if scene.contact is not None and self._contact is not None:
            partner = scene.contact[1]
            other = "" if partner is None else f" with vehicle {scene.slots[partner]}"
            name = " with the target" if partner == scene.target else other
            yield self._contact[0], last, note(f"COLLISION{name}")
        borders = np.sort(scene.road.boundaries)
        off = (scene.d[Role.EGO] < borders[0]) | (scene.d[Role.EGO] > borders[-1])
        if off.any():
            yield int(np.argmax(off)), last, note("LEFT THE LANES")


_OTHER = 2
_AWAY_STEP = 5.0  # A distance that changed with every frame could not be read [m].


def _free(away: list[tuple[bool, int]], is_left: bool, row: int, last: int) -> int:
    """The row nearest to a wished one in which no name lies at the same edge, and take it."""
    taken = [other for side, other in away if side == is_left]
    rows = sorted(range(2, last, 2), key=lambda one: abs(one - row))
    free = next((one for one in rows if all(abs(one - t) >= _TAG_PITCH for t in taken)), row)
    away.append((is_left, free))
    return free


def _contact(scene: Scene) -> tuple[int, float, float] | None:
    """First frame after the ego's first contact, and the place of the contact along and across."""
    if scene.contact is None:
        return None
    time, partner = scene.contact
    frame = min(math.ceil(time * RATE - 1e-6), scene.num_frames - 1)
    ego = (float(scene.s[0, frame]), float(scene.d[0, frame]))
    if partner is None:
        return frame, *ego
    other = (float(scene.s[partner, frame]), float(scene.d[partner, frame]))
    one = _nearest(scene, 0, frame, other)
    two = _nearest(scene, partner, frame, ego)
    return frame, 0.5 * (one[0] + two[0]), 0.5 * (one[1] + two[1])


def _nearest(
    scene: Scene, index: int, frame: int, point: tuple[float, float]
) -> tuple[float, float]:
    """The point of a body that is nearest to another point, on the road."""
    body, angle = scene.bodies[index], float(scene.angle[index, frame])
    centre = (float(scene.s[index, frame]), float(scene.d[index, frame]))
    cosine, sine = math.cos(angle), math.sin(angle)
    away = (point[0] - centre[0], point[1] - centre[1])
    ahead = np.clip(away[0] * cosine + away[1] * sine, -0.5 * body.length, 0.5 * body.length)
    left = np.clip(away[1] * cosine - away[0] * sine, -0.5 * body.width, 0.5 * body.width)
    return (
        float(centre[0] + ahead * cosine - left * sine),
        float(centre[1] + ahead * sine + left * cosine),
    )


def _breaches(
    scene: Scene, findings: Findings | None, articles: Mapping[str, str] | None
) -> list[tuple[int, int, Sprite]]:
    """What is broken from which to which frame of the film, the first one first."""
    if findings is None:
        return []
    notes: list[tuple[int, int, Sprite]] = []
    for rule, code in enumerate(findings.rules):
        is_told = articles is None or code in articles
        is_broken = is_told and findings.verdict[0, rule] == Verdict.ILLEGAL
        first, last = int(findings.first[0, rule]), int(findings.last[0, rule])
        if is_broken and first != NEVER:
            severity = palette.SEVERITIES[Severity(int(findings.severity[0, rule]))]
            text = (articles[code] if articles else code) + (f" ({severity})" if severity else "")
            frames = np.searchsorted(scene.recorded, [first, last])
            start, stop = (min(int(one), scene.num_frames - 1) for one in frames)
            notes.append((start, stop, note(text)))
    return sorted(notes, key=lambda one: one[0])


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


@lru_cache(maxsize=256)
def note(text: str) -> Sprite:
    """A warning, readable on anything."""
    short = text if len(text) <= _MAX_NOTE_LETTERS else text[: _MAX_NOTE_LETTERS - 3] + "..."
    letters = lettering(short, 13, bold=True)
    width, height = float(letters.width + 34), float(_NOTE_HEIGHT)
    sheet = Sheet((0.0, width, 0.0, height), 1.0)
    sheet.rect((0.0, width), (0.0, height), palette.WARNING, radius=4.0)
    sheet.rect((12.0, 14.5), (5.0, 14.5), palette.TEXT)
    sheet.rect((12.0, 14.5), (16.5, 19.0), palette.TEXT)
    sheet.write(letters, 24, (_NOTE_HEIGHT - letters.height) // 2 + 1, palette.TEXT)
    return sheet.sprite()


@lru_cache(maxsize=64)
def _burst(age: int, scale: float) -> Texture:
    """The flash of a collision, `age` frames old."""
    left = 1.0 - age / _FLASH_FRAMES
    reach = 3.0 + 3.0 * (1.0 - left)
    sheet = Sheet((-reach - 1.0, reach + 1.0, -reach - 1.0, reach + 1.0), scale, 2)
    sheet.glow(0.0, 0.0, reach, "#ff6a3d", 0.9 * left)
    sheet.glow(0.0, 0.0, 0.55 * reach, palette.FLASH, left)
    for x, y in ((reach, 0.18), (0.18, reach)):
        sheet.rect((-x, x), (-y, y), palette.FLASH, opacity=0.8 * left, radius=0.15)
    return sheet.texture()
