"""What is told of a film on the road itself: what is being broken, and how it ends badly."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from overtaking.model.events import NEVER
from overtaking.model.labels import Severity, Verdict
from overtaking.model.vehicles import Role
from overtaking.video import palette
from overtaking.video.canvas import WIDTH
from overtaking.video.scene import RATE
from overtaking.video.sheet import Sheet
from overtaking.video.text import lettering

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from overtaking.model.labels import Findings
    from overtaking.video.display import Part
    from overtaking.video.pictures import Sprite, Texture
    from overtaking.video.scene import Scene
    from overtaking.video.view import View

    Note = tuple[int, int, Sprite]
    """First and last frame of what is told, and its text."""

    Contact = tuple[int, float, float]
    """First frame after a contact, and its place along and across the road."""

_FLASH_FRAMES = 14
_NOTE_GAP = 8
_NOTE_HEIGHT = 24
_MAX_NOTE_LETTERS = 110


def tell(part: Part, notes: Sequence[Note], num_frames: int) -> None:
    """Put notes on the verge as long as there is room, in the frames that they are told in."""
    changes = {0, num_frames, *(one[0] for one in notes), *(one[1] + 1 for one in notes)}
    borders = sorted(changes)
    for first, after in pairwise(borders):
        column, row = _NOTE_GAP, part.height - _NOTE_HEIGHT - 2
        told = [sprite for begin, last, sprite in notes if begin <= first <= last]
        for sprite in told:
            if column + sprite.size[0] > WIDTH and column > _NOTE_GAP:
                column, row = _NOTE_GAP, row - _NOTE_HEIGHT - 2
            part.sprite(sprite, column, row, frames=np.arange(first, after))
            column += sprite.size[0] + _NOTE_GAP


def flash(part: Part, contact: Contact | None, view: View) -> None:
    """The flash of a collision, which fades."""
    if contact is None:
        return
    first, s, d = contact
    for frame in range(first, min(first + _FLASH_FRAMES, len(view.left))):
        burst = _burst(frame - first, view.scale)
        part.texture(burst, view.x(frame, s), view.y(d), frames=[frame])


def endings(scene: Scene, contact: Contact | None) -> Iterator[Note]:
    """Notes of how a film ends badly, from the frame on in which it is so."""
    last = scene.num_frames - 1
    if scene.contact is not None and contact is not None:
        partner = scene.contact[1]
        other = "" if partner is None else f" with vehicle {scene.slots[partner]}"
        name = " with the target" if partner == scene.target else other
        yield contact[0], last, note(f"COLLISION{name}")
    borders = np.sort(scene.road.boundaries)
    off = (scene.d[Role.EGO] < borders[0]) | (scene.d[Role.EGO] > borders[-1])
    if off.any():
        yield int(np.argmax(off)), last, note("LEFT THE LANES")


def contact(scene: Scene) -> Contact | None:
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


def breaches(
    scene: Scene, findings: Findings | None, articles: Mapping[str, str] | None
) -> list[Note]:
    """What is broken from which to which frame of the film, the first one first."""
    if findings is None:
        return []
    notes: list[Note] = []
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
