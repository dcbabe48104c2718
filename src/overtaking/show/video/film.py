"""A film of one simulation: a pure function from the number of a frame to its picture."""

import math

from overtaking.knowledge.glossary import terms
from overtaking.labels.law.judging import Policy, default_policy
from overtaking.labels.law.judging import stored_policy as policy_named
from overtaking.model.overtake_events import OvertakeEvents
from overtaking.model.road import Road
from overtaking.model.trajectories import Trajectories
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import Findings, OvertakeClass
from overtaking.show.video import notes, sky
from overtaking.show.video.ahead import Ahead
from overtaking.show.video.canvas import HEIGHT, WIDTH, Canvas
from overtaking.show.video.palette import INK
from overtaking.show.video.panel import Header, Timeline
from overtaking.show.video.road import centre_line, changes, strip
from overtaking.show.video.scene import scene
from overtaking.show.video.text import line
from overtaking.show.video.traffic import OnScreen, Traffic
from overtaking.show.video.view import SCENE_BOTTOM, SCENE_TOP, view

_SIGN_EVERY = 100  # Metres between two distances beside the road.
_SIGN = "#e4e8e6"

_STRAIGHT = 1.0 / 5000.0  # A wider bend cannot be told from a straight road [1/m].
_LEVEL = 0.005  # A slope that is written as 1 % or more.


class Film:
    """The frames of a film.

    Drawing depends on nothing but the simulation and the number of the frame: the same arrays every
    time, in any order.

    Args:
        run: A batch of one simulation.
        title: Its name in the film.
        events: What happened in it, if it is known.
        findings: What the rules say of it; breaches are shown as they happen.
        policy: The policy whose rules count, None for the default of the profile; breaches of other
            rules are grey.
        label: Class of the simulation under this policy.
        axis: Frames that the time axis spans at least, for films beside each other.

    Attributes:
        meaning: Explanation of the class in the header; empty without a class.

    Raises:
        ConfigError: The batch holds another number of simulations than one.
    """

    def __init__(
        self,
        run: Trajectories,
        *,
        title: str = "Simulation",
        events: OvertakeEvents | None = None,
        findings: Findings | None = None,
        policy: Policy | None = None,
        label: OvertakeClass | None = None,
        axis: int = 0,
    ) -> None:
        """Prepare the layers that many frames share."""
        self.scene = scene(run, events)
        self.view = view(self.scene)
        self._sky = seen = sky.sky(run)
        self.traffic = Traffic(self.scene, self.view, seen.shade, seen.spray)
        self.contact = notes.contact(self.scene)
        policy = policy or policy_named(default_policy(run.scenario.profile))
        told = notes.breaches(self.scene, findings, policy)
        self._notes = [*notes.endings(self.scene, self.contact), *told]
        subtitle = run.scenario.profile + ("" if label is None else f" · {label.title}")
        self.meaning = "" if label is None else explained(label.title, policy.name)
        self._header = Header(title, subtitle, self.meaning, seen.text)
        self._timeline = Timeline(self.scene, told, max(axis, self.num_frames))
        self._road = strip(self.scene.road, self.view.scale, self.view.middle_d, seen.tone)
        self._ahead = Ahead(self.scene) if self.scene.road.is_two_way else None
        self._fog, self._glare = sky.fog(seen, self.view.scale), sky.glare(seen)

    @property
    def num_frames(self) -> int:
        """Number of frames, `RATE` of them a second."""
        return self.scene.num_frames

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        return WIDTH, HEIGHT

    def draw(self, frame: int, out: Canvas | None = None) -> Canvas:
        """Draw a frame.

        Args:
            frame: Its number, 0 <= frame < num_frames.
            out: What to draw on, of `WIDTH` and `HEIGHT`; made if missing.

        Returns:
            The picture; `rgb()` gives it as an array.
        """
        if not 0 <= frame < self.num_frames:
            raise IndexError(f"frame: expected 0 to {self.num_frames - 1}, got {frame}")
        canvas = Canvas(WIDTH, HEIGHT, "#000000") if out is None else out
        places = self.traffic.at(frame)
        first = int(self.view.left[frame]) % self._road.period
        canvas.copy_columns(self._road.canvas, 0, SCENE_TOP, (first, first + WIDTH))
        if changes(self.scene.road):
            line_between = centre_line(self.scene.road, self.view, frame, self._sky.tone)
            canvas.draw(line_between, 0.0, float(SCENE_TOP))
        self.traffic.draw_bodies(canvas, places)
        self._hide(canvas, places, frame)
        self.traffic.draw_lamps(canvas, places, frame)
        self._rain(canvas, frame)
        self._signs(canvas, frame)
        self._shape(canvas, frame)
        self.traffic.draw_marks(canvas, places, frame)
        notes.flash(canvas, self.contact, self.view, frame)
        if self._ahead is not None:
            self._ahead.draw(canvas, frame)
        notes.tell(canvas, self._notes, frame)
        self._header.draw(canvas, None if self.scene.stage is None else self.scene.stage[frame])
        self._timeline.draw(canvas, frame)
        return canvas

    def _hide(self, canvas: Canvas, places: list[OnScreen], frame: int) -> None:
        """Night, low sun and fog; lamps are drawn later, as they are seen through all of them."""
        rows = SCENE_TOP, SCENE_BOTTOM
        if self._glare is not None:
            canvas.blend_colour(rows, *self._glare)
        if self._sky.is_night:
            lights = [
                (light.power, round(0.5 * x) + light.left, round(0.5 * (y - SCENE_TOP)) + light.top)
                for light, x, y in self.traffic.lights(places, frame)
            ]
            canvas.darken(rows, sky.MOONLIGHT, lights)
        if self._fog is not None:
            first = min(max(WIDTH - round(float(self.traffic.x[EGO_SLOT, frame])), 0), WIDTH)
            canvas.blend_colour(rows, self._fog.hidden[first : first + WIDTH], self._fog.colour)

    def _rain(self, canvas: Canvas, frame: int) -> None:
        """Streaks of rain, in some pictures that take turns."""
        if self._sky.rate > 0.0:
            height, is_night = SCENE_BOTTOM - SCENE_TOP, self._sky.is_night
            pictures = sky.rain(self._sky.rate, height, is_night=is_night)
            canvas.draw_placed([(pictures[2 * frame % len(pictures)], 0, SCENE_TOP, 0)], 1.0)

    def _signs(self, canvas: Canvas, frame: int) -> None:
        """Distances along the road, at the upper edge."""
        shown = WIDTH / self.view.scale
        left = int(self.view.left[frame]) / self.view.scale
        first = math.ceil(left / _SIGN_EVERY) * _SIGN_EVERY
        is_pale = not self._sky.is_night and self._sky.extinction * 0.5 * shown > math.log(2.0)
        for s in range(first, int(left + shown) + 1, _SIGN_EVERY):
            sign = line(f"{s} m", 11, INK if is_pale else _SIGN)
            column = round((s - left) * self.view.scale) - sign.width // 2
            canvas.draw(sign.drawing, column, SCENE_TOP + 2)

    def _shape(self, canvas: Canvas, frame: int) -> None:
        """Which way a road that is drawn straight bends and rises at the ego, at the lower edge."""
        if text := shape_of(self.scene.road, float(self.scene.s[EGO_SLOT, frame])):
            told = line(text, 11, _SIGN)
            canvas.draw(told.drawing, WIDTH - 12 - told.width, SCENE_BOTTOM - 18)


def shape_of(road: Road, s: float) -> str:
    """How a road that the picture shows straight and level bends and rises at a station [m]."""
    if road.course is None or not (road.course.segments or road.course.grade):
        return ""
    bend, slope = float(road.curvature_at(s)), float(road.grade_at(s))
    parts = ["here straight"]
    if abs(bend) > _STRAIGHT:
        side = "left" if bend > 0.0 else "right"
        parts = [f"here a bend to the {side}, radius {1.0 / abs(bend):.0f} m"]
    if abs(slope) >= _LEVEL:
        parts.append(f"{'uphill' if slope > 0.0 else 'downhill'} {100.0 * abs(slope):.0f} %")
    return f"road shown straight; {', '.join(parts)}"


def explained(label: str, policy: str) -> str:
    """A class under a policy in a few words."""
    return f"{terms('classes')[label].title} · policy {policy}: {terms('policies')[policy].title}"
