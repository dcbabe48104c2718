"""Notes on the road of a film: rules as they are broken, and a bad end."""

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from overtaking.labels.law.judging import STORED_POLICIES, Policy
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.overtake_events import NEVER
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import Findings, Severity, Verdict
from overtaking.show.video import palette
from overtaking.show.video.canvas import WIDTH, Canvas, Drawing
from overtaking.show.video.road import lane_borders
from overtaking.show.video.scene import RATE, FilmScene
from overtaking.show.video.text import Picture, lettering
from overtaking.show.video.view import SCENE_BOTTOM, SCENE_TOP, Camera
from overtaking.show.wording import words

Contact = tuple[int, float, float]
"""First frame after a contact, and its place along and across the road."""

_FLASH_FRAMES = 14
_NOTE_GAP = 8
_NOTE_HEIGHT = 24
_MAX_NOTE_LETTERS = 110


class Note(NamedTuple):
    """A text on the road.

    Attributes:
        first: First frame that shows it.
        last: Last frame that shows it.
        text: What it says.
        counts: Whether it bears on the class of the simulation; else it is grey.
    """

    first: int
    last: int
    text: str
    counts: bool = True


def tell(canvas: Canvas, notes: Sequence[Note], frame: int) -> None:
    """Draw the notes of a frame on the verge, as long as there is room."""
    column, row = _NOTE_GAP, SCENE_BOTTOM - _NOTE_HEIGHT - 2
    for one in notes:
        if one.first <= frame <= one.last:
            picture = note(one.text, counts=one.counts)
            if column + picture.width > WIDTH and column > _NOTE_GAP:
                column, row = _NOTE_GAP, row - _NOTE_HEIGHT - 2
            canvas.draw(picture.drawing, column, row)
            column += picture.width + _NOTE_GAP


def flash(canvas: Canvas, contact: Contact | None, camera: Camera, frame: int) -> None:
    """Draw the flash of a collision, which fades."""
    if contact is None:
        return
    first, s, d = contact
    if first <= frame < first + _FLASH_FRAMES:
        place = camera.x(frame, s), SCENE_TOP + camera.y(d)
        canvas.draw_placed([(_burst(frame - first), *place, 0.0)], camera.scale)


def endings(scene: FilmScene, contact: Contact | None) -> Iterator[Note]:
    """Notes about a bad end, from the frame of its event on."""
    last = scene.num_frames - 1
    if scene.contact is not None and contact is not None:
        partner = scene.contact[1]
        other = "" if partner is None else f" with vehicle {scene.slots[partner]}"
        name = " with the target" if partner == scene.target else other
        yield Note(contact[0], last, f"COLLISION{name}")
    borders = np.sort(lane_borders(scene.road))
    off = (scene.d[EGO_SLOT] < borders[0]) | (scene.d[EGO_SLOT] > borders[-1])
    if off.any():
        yield Note(int(np.argmax(off)), last, "LEFT THE LANES")


def contact(scene: FilmScene) -> Contact | None:
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
    scene: FilmScene, index: int, frame: int, point: tuple[float, float]
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


def breaches(scene: FilmScene, findings: Findings | None, policy: Policy) -> list[Note]:
    """Breaches of the ego's duties, those that the policy does not count marked as such.

    Args:
        scene: The drawn simulation.
        findings: What the rules find; None gives no notes.
        policy: Which rules count.
    """
    articles = articles_of(policy)
    notes: list[Note] = []
    for rule, code in enumerate(findings.rule_codes if findings else ()):
        assert findings is not None
        first, last = int(findings.first_frame[0, rule]), int(findings.last_frame[0, rule])
        is_broken = findings.verdict[0, rule] == Verdict.ILLEGAL and first != NEVER
        if is_broken and code in articles:
            severity = words(Severity(int(findings.severity[0, rule])).name)
            counts = code in policy.required
            text = f"{articles[code]} ({severity})"
            text += "" if counts else f" - not counted by policy {policy.name}"
            frames = np.searchsorted(scene.recorded, [first, last])
            start, stop = (min(int(one), scene.num_frames - 1) for one in frames)
            notes.append(Note(start, stop, text, counts))
    return sorted(notes, key=lambda one: (not one.counts, one.first))


def articles_of(policy: Policy) -> dict[str, str]:
    """Article and title of each rule that a film shows, by code.

    These are the ego's duties. Of a rule with two readings only the one that the policy requires
    is shown.
    """
    elsewhere = {code for one in STORED_POLICIES for code in one.required} - set(policy.required)
    return {
        rule.code: f"{rule.article}: {rule.title}"
        for rule in PORTUGAL.rules
        if rule.is_duty_of_ego and not _is_other_reading(rule.code, policy.required, elsewhere)
    }


def _is_other_reading(code: str, required: tuple[str, ...], elsewhere: set[str]) -> bool:
    """Whether a rule is one of two readings, and the policy requires the other or neither."""
    stem = code.rstrip("s")
    return code not in required and code in elsewhere and f"{stem}s" in elsewhere | set(required)


@lru_cache(maxsize=256)
def note(text: str, *, counts: bool = True) -> Picture:
    """A warning, readable on anything: red, or grey if it does not count."""
    short = text if len(text) <= _MAX_NOTE_LETTERS else text[: _MAX_NOTE_LETTERS - 3] + "..."
    letters = lettering(short, 13, bold=counts)
    width, drawing = letters.shape[1] + (34 if counts else 16), Drawing()
    ground = palette.WARNING if counts else palette.ASIDE
    drawing.rect((0.0, float(width)), (0.0, float(_NOTE_HEIGHT)), ground, radius=4.0)
    if counts:
        drawing.rect((12.0, 14.5), (5.0, 14.5), palette.TEXT)
        drawing.rect((12.0, 14.5), (16.5, 19.0), palette.TEXT)
    row = (_NOTE_HEIGHT - letters.shape[0]) // 2 + 1
    drawing.mask(letters, (24 if counts else 8, row), palette.TEXT)
    return Picture(drawing, width, _NOTE_HEIGHT)


@lru_cache(maxsize=64)
def _burst(age: int) -> Drawing:
    """The flash of a collision, `age` frames old, in metres."""
    left = 1.0 - age / _FLASH_FRAMES
    reach, drawing = 3.0 + 3.0 * (1.0 - left), Drawing()
    drawing.glow(0.0, 0.0, reach, "#ff6a3d", 0.9 * left)
    drawing.glow(0.0, 0.0, 0.55 * reach, palette.FLASH, left)
    for x, y in ((reach, 0.18), (0.18, reach)):
        drawing.rect((-x, x), (-y, y), palette.FLASH, opacity=0.8 * left, radius=0.15)
    return drawing
