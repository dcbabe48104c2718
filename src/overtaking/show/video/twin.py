"""A film of twins: a simulation as it was, and below it the same with something changed."""

from overtaking.analysis.whatif.twin import Twin
from overtaking.labels.law.judging import choose_policy
from overtaking.labels.law.judging import stored_policy as policy_named
from overtaking.model.verdicts import OvertakeClass
from overtaking.show.video import palette
from overtaking.show.video.canvas import HEIGHT, WIDTH, Canvas
from overtaking.show.video.film import Film
from overtaking.show.video.scene import RATE, scene
from overtaking.show.video.text import line

_BAR = 32
"""Rows between the two, which say what differs."""

_MARGIN, _ROW, _SIZE = 12, 7, 15


class TwinFilm:
    """The frames of both, one above the other; who ends first waits for the other.

    Args:
        one: The twins.
        policy: Name of the policy whose rules count; None for the default of the profile.
    """

    def __init__(self, twin: Twin, policy: str | None = None) -> None:
        """Prepare both films."""
        counted = policy_named(choose_policy(policy, twin.profile))
        axis = max(scene(simulation.run).num_frames for simulation in twin.told)
        self._films: list[Film] = []
        for simulation, labelled in zip(twin.told, twin.labelled, strict=True):
            codes = labelled.labels.classes[0]
            self._films.append(
                Film(
                    simulation.run,
                    title=f"Simulation {twin.number}, {simulation.title}",
                    events=labelled.events,
                    findings=labelled.findings,
                    policy=counted,
                    label=OvertakeClass(int(codes[labelled.labels.policies.index(counted.name)])),
                    axis=axis,
                )
            )
        self._above = Canvas(WIDTH, HEIGHT, "#000000")
        since = "drawn again" if twin.effect == "total" else f"changed at {twin.since:.2f} s"
        self._caption = f"above as it was, below {twin.title}: {twin.effect} effect, {since}"
        self._parting = None if twin.parting is None else twin.parting.time

    @property
    def num_frames(self) -> int:
        """Frames of the longer one."""
        return max(film.num_frames for film in self._films)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        return WIDTH, 2 * HEIGHT + _BAR

    def draw(self, frame: int, out: Canvas | None = None) -> Canvas:
        """Draw a frame.

        Args:
            frame: Its number, 0 <= frame < num_frames.
            out: What to draw on, of `size`; made if missing.
        """
        canvas = Canvas(*self.size, palette.PANEL) if out is None else out
        for film, row in zip(self._films, (0, HEIGHT + _BAR), strict=True):
            film.draw(min(frame, film.num_frames - 1), self._above)
            canvas.copy_columns(self._above, 0, row, (0, WIDTH))
        self._tell(canvas, frame)
        return canvas

    def _tell(self, canvas: Canvas, frame: int) -> None:
        """What differs, and whether the two have parted."""
        bar = Canvas(WIDTH, _BAR, palette.PANEL)
        canvas.copy_columns(bar, 0, HEIGHT, (0, WIDTH))
        caption = line(self._caption, _SIZE, palette.TEXT)
        canvas.draw(caption.drawing, _MARGIN, HEIGHT + _ROW)
        text, colour = self._state(frame)
        state = line(text, _SIZE, colour, bold=True)
        canvas.draw(state.drawing, WIDTH - _MARGIN - state.width, HEIGHT + _ROW)

    def _state(self, frame: int) -> tuple[str, str]:
        if self._parting is None:
            return "they never part", palette.FAINT
        if frame < round(self._parting * RATE):
            return "still the same", palette.FAINT
        return f"apart since {self._parting:.2f} s", palette.TARGET
