"""The colours of the films."""

from overtaking.model.trajectories import Stage
from overtaking.model.vehicles import Colour


def mixed(colour: str, other: str, share: float) -> str:
    """A colour with a share of another one, 0 to 1."""
    pairs = ((int(one[i : i + 2], 16) for one in (colour, other)) for i in (1, 3, 5))
    return "#" + "".join(f"{round(a + share * (b - a)):02x}" for a, b in pairs)


def tinted(colour: str, factors: tuple[float, float, float]) -> str:
    """A colour in a light that is not white."""
    parts = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return "#" + "".join(
        f"{min(round(p * f), 255):02x}" for p, f in zip(parts, factors, strict=True)
    )


INK = "#14181d"
PANEL = "#1b2026"
PANEL_EDGE = "#39424c"
GRID = "#2b333c"
TEXT = "#eef1f4"
FAINT = "#98a3af"
EGO = "#56b4e9"
TARGET = "#f0a830"
GAP = "#cfd6dd"
WARNING = "#d03a2b"
ASIDE = "#59636e"
"""Of breaches that do not count."""
FLASH = "#fff3c4"

PAINT = {
    Colour.YELLOW: "#f2cf2e",
    Colour.BLUE: "#2f6fd0",
    Colour.RED: "#cc2f2f",
    Colour.GREEN: "#2f9a55",
    Colour.ORANGE: "#ee7d22",
    Colour.GREY: "#9aa3ab",
    Colour.WHITE: "#f4f5f5",
    Colour.BROWN: "#7d5334",
}
GLASS = "#1d2731"
TRIM = "#20252a"
SKIN = "#2a3038"

LAMP_OFF = "#d9dee2"
LAMP_ON = "#fff6d8"
TAIL_OFF = "#6d1414"
TAIL_ON = "#c51d1d"
BRAKE_ON = "#ff3b30"
INDICATOR_ON = "#ffb000"
FOG_LAMP = "#ff2a2a"

# Okabe and Ito's colours, which people with any kind of colour vision can tell apart; the same as
# on the terminal. The second colour is that of text on it.
STAGES = {
    Stage.FOLLOW: ("Follow", "#56b4e9", INK),
    Stage.PULL_OUT: ("Pull out", "#f0e442", INK),
    Stage.PASS: ("Pass", "#3f8fd0", TEXT),
    Stage.RETURN: ("Return", "#e69f00", INK),
    Stage.DONE: ("Done", "#14a27c", TEXT),
    Stage.ABORT: ("Abort", "#cc79a7", INK),
    Stage.CRASHED: ("Crashed", "#d55e00", TEXT),
}
