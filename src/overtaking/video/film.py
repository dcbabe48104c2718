"""A film of one simulation: a pure function from the number of a frame to its picture."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from overtaking.model.vehicles import Role
from overtaking.rules import POLICIES
from overtaking.video import notes, sky
from overtaking.video.canvas import FRAME_SHAPE, HEIGHT, WIDTH
from overtaking.video.display import Display
from overtaking.video.palette import INK
from overtaking.video.panel import Header, Timeline
from overtaking.video.road import strip
from overtaking.video.scene import scene
from overtaking.video.text import line
from overtaking.video.traffic import Traffic
from overtaking.video.view import SCENE_BOTTOM, SCENE_TOP, view
from overtaking.video.words import explained

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.model.events import Events
    from overtaking.model.labels import Findings, OvertakeClass
    from overtaking.model.trajectory import Trajectories
    from overtaking.rules import Policy
    from overtaking.video.canvas import U8
    from overtaking.video.display import Part

_SIGN_EVERY = 100  # Metres between two distances beside the road.
_SIGN = "#e4e8e6"


class Film:
    """The frames of a film.

    Drawing depends on nothing but the simulation and the number of the frame: the same arrays every
    time, in any order.

    Args:
        run: A batch of one simulation.
        title: Its name in the film.
        events: What happened in it, if it is known.
        findings: What the rules say of it; breaches are shown as they happen.
        policy: Which rules count; breaches of others are grey.
        label: Class of the simulation under this policy.

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
        policy: Policy = POLICIES[0],
        label: OvertakeClass | None = None,
    ) -> None:
        """List what is on all frames."""
        self.scene = scene(run, events)
        self.view = view(self.scene)
        self.traffic = Traffic(self.scene, self.view)
        self.contact = notes.contact(self.scene)
        self._sky = sky.sky(run)
        told = notes.breaches(self.scene, findings, policy)
        self._notes = [*notes.endings(self.scene, self.contact), *told]
        self._display = Display(self.scene.num_frames)
        subtitle = (
            run.scenario.profile if label is None else f"{run.scenario.profile} · {label.title}"
        )
        meaning = "" if label is None else explained(label, policy.name)
        header = Header(title, subtitle, meaning, self._sky.text)
        header.lay(self._display.part(0, SCENE_TOP), self.scene.stage)
        self._road(self._display.part(SCENE_TOP, SCENE_BOTTOM))
        timeline = Timeline(self.scene, told)
        timeline.lay(self._display.part(SCENE_BOTTOM, HEIGHT))

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
        self._display.draw(frame, picture)
        return picture

    def _road(self, part: Part) -> None:
        """The part of the picture with the road."""
        seen = self._sky
        road = strip(self.scene.road, self.view.scale, self.view.middle_d, seen.tone)
        road.lay(part, self.view.left)
        self.traffic.lay_bodies(part, seen.shade, seen.spray)
        self._hide(part)
        self.traffic.lay_lamps(part)
        self._rain(part)
        self._signs(part)
        self.traffic.lay_marks(part)
        notes.flash(part, self.contact, self.view)
        notes.tell(part, self._notes, self.num_frames)

    def _hide(self, part: Part) -> None:
        """Night, low sun and fog; lamps are drawn later, as they are seen through all of them."""
        fog, glare = sky.fog(self._sky, self.view.scale), sky.glare(self._sky)
        ego = self.traffic.x[Role.EGO]
        first = np.clip(WIDTH - 2 * np.rint(0.5 * ego), 0, WIDTH)
        if glare is not None:
            part.veil(glare)
        if self._sky.is_night:
            self.traffic.illuminate(part)
            part.night(fog, first)
        elif fog is not None:
            part.veil(fog, first)

    def _rain(self, part: Part) -> None:
        """Streaks of rain, in some pictures that take turns."""
        rate = self._sky.rate
        if rate > 0.0:
            pictures = sky.rain(rate, part.height, is_night=self._sky.is_night)
            turn = 2 * np.arange(self.num_frames) % len(pictures)
            for number, picture in enumerate(pictures):
                part.rain(picture, frames=np.flatnonzero(turn == number))

    def _signs(self, part: Part) -> None:
        """Distances along the road, at the upper edge."""
        left: NDArray[np.float64] = self.view.left / self.view.scale
        shown = WIDTH / self.view.scale
        first = math.ceil(left.min() / _SIGN_EVERY) * _SIGN_EVERY
        is_pale = not self._sky.is_night and self._sky.extinction * 0.5 * shown > math.log(2.0)
        for s in range(first, int(left.max() + shown) + 1, _SIGN_EVERY):
            frames = np.flatnonzero((left <= s) & (s <= left + shown))
            text = line(f"{s} m", 11, INK if is_pale else _SIGN)
            columns = 2 * np.rint(0.5 * (s * self.view.scale - self.view.left[frames]))
            part.sprite(text, columns - text.size[0] // 4 * 2, 2, frames=frames)
