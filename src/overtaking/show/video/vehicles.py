"""Vehicles from above: body, shadow, lamps, and the marks of ego and target."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from overtaking.model.trajectories import Lights
from overtaking.model.vehicles import Colour, VehicleKind
from overtaking.show.video import palette
from overtaking.show.video.canvas import Drawing

_GLOW = 1.1  # Reach of a lamp's glow [m].
_RING = 0.45  # Distance of the marks from the body [m].
_MAX_KEPT_SHADOW = 5.0  # The shadow of a truck at sunset would cover the lanes [m].
_SPRAY_LENGTH = 7.0
_TWO_WHEELERS = (VehicleKind.MOTORCYCLE, VehicleKind.BICYCLE)
_ROUNDNESS = {VehicleKind.VAN: 0.28, VehicleKind.TRUCK: 0.12}
_LOUDEST_SPRAY = 0.30


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """What of a vehicle can be seen from above.

    Attributes:
        kind: Type.
        colour: Paint.
        length: Bumper to bumper [m].
        width: [m].
        height: [m], for its shadow.
    """

    kind: VehicleKind
    colour: Colour
    length: float
    width: float
    height: float


def painted(body: Body, shade: tuple[float, float, float], spray: float) -> Drawing:
    """The body with its shadow and the spray behind it, in metres.

    Args:
        body: What to paint; it drives towards growing x, its centre at the origin.
        shade: Length of the shadow per height of what casts it, forwards and to the right, and how
            dark it is, 0 to 1.
        spray: 0 none to 1 as of a truck in heavy rain.
    """
    drawing, half = Drawing(), (0.5 * body.length, 0.5 * body.width)
    _spray(drawing, half, spray)
    _cast(drawing, half, _shadow(body, shade), shade[2])
    _PAINTERS.get(body.kind, _car)(drawing, body)
    return drawing


@lru_cache(maxsize=1024)
def lamps(body: Body, lights: int) -> Drawing:
    """The lamps that are lit, with their glow, in metres.

    Args:
        body: As for `painted`.
        lights: `Lights` bits; an indicator that blinks is dark or lit here.
    """
    drawing, half = Drawing(), (0.5 * body.length, 0.5 * body.width)
    across = (0.0,) if body.kind in _TWO_WHEELERS else (-half[1] + 0.3, half[1] - 0.3)
    front, rear, beams = half[0] - 0.12, -half[0] + 0.12, Lights.LOW_BEAM | Lights.HIGH_BEAM
    for bits, x, places, colour, reach in (
        (beams, front, across, palette.LAMP_ON, 0.7),
        (beams, rear, across, palette.TAIL_ON, 0.5),
        (Lights.REAR_FOG, rear, across[-1:], palette.FOG_LAMP, _GLOW),
        (Lights.BRAKE, -half[0] + 0.10, across, palette.BRAKE_ON, _GLOW),
    ):
        for y in places if lights & bits else ():
            drawing.glow(x, y, reach, colour, 0.75)
            drawing.rect((x - 0.14, x + 0.14), (y - 0.22, y + 0.22), colour, radius=0.1)
    for bit, side in ((Lights.INDICATOR_LEFT, -1.0), (Lights.INDICATOR_RIGHT, 1.0)):
        y = side * (half[1] - 0.1)
        for x in (half[0] - 0.25, -half[0] + 0.25) if lights & bit else ():
            drawing.glow(x, y, _GLOW, palette.INDICATOR_ON, 0.9)
            drawing.rect(
                (x - 0.28, x + 0.28), (y - 0.17, y + 0.17), palette.INDICATOR_ON, radius=0.1
            )
    return drawing


@lru_cache(maxsize=64)
def mark(body: Body, scale: float, *, is_ego: bool) -> Drawing:
    """A ring around the ego, or corners around the target: told apart without colour.

    Args:
        body: What to mark.
        scale: [px/m]; lines are two pixels wide.
        is_ego: Whether it is the ego.
    """
    drawing, line = Drawing(), 2.0 / scale
    half = (0.5 * body.length + _RING, 0.5 * body.width + _RING)
    if is_ego:
        drawing.outline(
            (-half[0], half[0]), (-half[1], half[1]), palette.EGO, line=line, radius=0.6
        )
        return drawing
    arm = min(0.9, 0.6 * half[1])
    x, y = (one - 0.5 * line for one in half)
    for right in (-1.0, 1.0):
        for down in (-1.0, 1.0):
            corner = [(x - arm, y), (x, y), (x, y - arm)]
            drawing.lines([[(right * a, down * b) for a, b in corner]], palette.TARGET, width=line)
    return drawing


def _shadow(body: Body, shade: tuple[float, float, float]) -> tuple[float, float]:
    """How far the shadow reaches, forwards and to the right [m]."""
    if shade[2] <= 0.0:
        return 0.0, 0.0
    along, across = body.height * shade[0], body.height * shade[1]
    size = (along * along + across * across) ** 0.5
    factor = min(1.0, _MAX_KEPT_SHADOW / max(size, 1e-6))
    return along * factor, across * factor


def _cast(
    drawing: Drawing, half: tuple[float, float], reach: tuple[float, float], darkness: float
) -> None:
    """A shadow: the outline of the body, drawn out to where the roof's edge falls."""
    if darkness <= 0.0:
        return
    # The hull of the body and of the same moved: six corners, from the one that moves least on.
    x, y = (math.copysign(one, to) for one, to in zip(half, reach, strict=True))
    along, across = x + reach[0], y + reach[1]
    hull = [(-x, -y), (x, -y), (along, -y + reach[1]), (along, across), (-x + reach[0], across)]
    drawing.polygon([*hull, (-x, y)], "#05080b", opacity=darkness)


def _spray(drawing: Drawing, half: tuple[float, float], spray: float) -> None:
    """The plume that the wheels throw up."""
    if spray <= 0.0:
        return
    for part, reach in ((0.15, 1.3), (0.4, 1.7), (0.7, 2.1)):
        place = -half[0] - part * (_SPRAY_LENGTH - 1.0)
        strength = min(spray, 1.0) * _LOUDEST_SPRAY * (1.3 - part)
        drawing.glow(place, 0.0, min(reach, half[1] * 2.0), "#e6ebef", strength)


def _shell(drawing: Drawing, body: Body, radius: float) -> tuple[float, float]:
    """The painted outline that every body with four wheels has; half its length and width."""
    x, y, paint = 0.5 * body.length, 0.5 * body.width, palette.PAINT[body.colour]
    drawing.rect((-x, x), (-y, y), palette.mixed(paint, "#000000", 0.55), radius=radius)
    inner = max(radius - 0.1, 0.02)
    drawing.rect((-x + 0.1, x - 0.1), (-y + 0.1, y - 0.1), paint, radius=inner)
    return x, y


def _unlit(drawing: Drawing, x: float, y: float) -> None:
    """Lamps that are off."""
    for place in ((0.14 - y, 0.50 - y), (y - 0.50, y - 0.14)):
        drawing.rect((x - 0.24, x - 0.06), place, palette.LAMP_OFF)
        drawing.rect((-x + 0.06, -x + 0.22), place, palette.TAIL_OFF)


def _car(drawing: Drawing, body: Body) -> None:
    """A car: bonnet, glass all around, roof."""
    radius = _ROUNDNESS.get(body.kind, 0.42)
    x, y = _shell(drawing, body, radius)
    paint = palette.PAINT[body.colour]
    front, back = 0.36 * x, -0.74 * x
    drawing.rect((back, front), (-y + 0.16, y - 0.16), palette.GLASS, radius=0.30)
    roof = (back + 0.13 * body.length, front - 0.14 * body.length)
    drawing.rect(roof, (-y + 0.30, y - 0.30), palette.mixed(paint, "#ffffff", 0.12), radius=0.15)
    _unlit(drawing, x, y)


def _van(drawing: Drawing, body: Body) -> None:
    """A van: short bonnet, windscreen, and a roof up to the rear doors."""
    x, y = _shell(drawing, body, _ROUNDNESS[VehicleKind.VAN])
    drawing.rect((0.56 * x, 0.78 * x), (-y + 0.18, y - 0.18), palette.GLASS, radius=0.12)
    roof = palette.mixed(palette.PAINT[body.colour], "#ffffff", 0.15)
    drawing.rect((-x + 0.22, 0.52 * x), (-y + 0.22, y - 0.22), roof, radius=0.15)
    _unlit(drawing, x, y)


def _truck(drawing: Drawing, body: Body) -> None:
    """A rigid truck: cab, gap, box with ribs."""
    x, y, paint = 0.5 * body.length, 0.5 * body.width, palette.PAINT[body.colour]
    cab = min(2.2, 0.3 * body.length)
    drawing.rect((-x, x), (-y + 0.25, y - 0.25), palette.TRIM, radius=0.1)
    drawing.rect(
        (x - cab, x), (-y + 0.06, y - 0.06), palette.mixed(paint, "#000000", 0.45), radius=0.25
    )
    drawing.rect((x - cab + 0.1, x - 0.1), (-y + 0.16, y - 0.16), paint, radius=0.2)
    drawing.rect((x - 0.72, x - 0.22), (-y + 0.22, y - 0.22), palette.GLASS, radius=0.1)
    box = (-x, x - cab - 0.4)
    drawing.rect(box, (-y, y), palette.mixed(paint, "#000000", 0.5), radius=0.08)
    inner = (box[0] + 0.12, box[1] - 0.12)
    drawing.rect(inner, (-y + 0.12, y - 0.12), palette.mixed(paint, "#ffffff", 0.2))
    for place in np.arange(inner[0] + 1.0, inner[1] - 0.4).tolist():
        ribs = (place, place + 0.1)
        drawing.rect(ribs, (-y + 0.12, y - 0.12), palette.mixed(paint, "#000000", 0.2), opacity=0.6)
    _unlit(drawing, x, y)


def _two_wheeler(drawing: Drawing, body: Body) -> None:
    """A machine with a rider on it, wide enough to be seen."""
    x, y, paint = 0.5 * body.length, 0.5 * body.width, palette.PAINT[body.colour]
    wheel = 0.12 if body.kind is VehicleKind.BICYCLE else 0.2
    drawing.rect((-x, x), (-wheel, wheel), palette.TRIM, radius=wheel)
    drawing.rect((0.40 * x, 0.55 * x), (-y, y), palette.TRIM, radius=0.05)
    drawing.rect((-0.5 * x, 0.35 * x), (-0.7 * wheel - 0.06, 0.7 * wheel + 0.06), paint, radius=0.1)
    drawing.rect((-0.45 * x, 0.2 * x), (-0.85 * y, 0.85 * y), palette.SKIN, radius=0.2)
    drawing.rect((-0.38 * x, 0.12 * x), (-0.7 * y, 0.7 * y), paint, radius=0.18)
    drawing.rect(
        (-0.14 * x, 0.16 * x), (-0.16, 0.16), palette.mixed(paint, "#ffffff", 0.75), radius=0.15
    )


_PAINTERS = {
    VehicleKind.VAN: _van,
    VehicleKind.TRUCK: _truck,
    VehicleKind.MOTORCYCLE: _two_wheeler,
    VehicleKind.BICYCLE: _two_wheeler,
}
