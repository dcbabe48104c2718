"""What is on each frame of a film: a list that is made once, and drawn from by compiled code."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking import _core
from overtaking.video.canvas import HEIGHT, WIDTH

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from overtaking.video import pictures
    from overtaking.video.canvas import U8
    from overtaking.video.pictures import Sprite, Streaks, Texture, Tile, Veil
    from overtaking.video.sky import Light

    Picture = Tile | Sprite | Texture | Veil | Streaks | pictures.Light

MOONLIGHT = 92
"""What is left of the day's light at night, of 256."""

_KIND = {name: number for number, name in enumerate(_core.item_kinds())}
_NONE = -1
_EVERYTHING = slice(None)
_ONE = 1 << 16  # Scale of cosines and sines, which are thereby the same on every machine.

_TURN = 0.0025
"""Step of angles: the ends of a long truck move by a sixth of a pixel [rad]."""

_STRAIGHT = 0.35
"""A sheet whose ends are moved by less by a turn is drawn straight [px]."""


class Display:
    """The frames of a film, each a list of pictures and places.

    What is added later lies above what was there before.

    Args:
        num_frames: Number of frames.
    """

    def __init__(self, num_frames: int) -> None:
        """Nothing on any frame."""
        self.num_frames = num_frames
        self._frames = _core.Frames(WIDTH, HEIGHT, MOONLIGHT)
        self._numbers: dict[int, tuple[Picture, int]] = {}
        self._items: list[tuple[NDArray[np.intp], NDArray[np.int32]]] = []
        self._is_listed = False

    def part(self, top: int = 0, bottom: int = HEIGHT) -> Part:
        """Some of the rows to draw on, both even."""
        return Part(self, top, bottom)

    def draw(self, frame: int, out: U8) -> None:
        """Draw a frame, or what is on it, over another picture.

        Args:
            frame: Its number, 0 <= frame < num_frames.
            out: Of `canvas.FRAME_SHAPE`, contiguous.
        """
        if not self._is_listed:
            self._list()
        self._frames.draw(frame, out)

    def add(
        self, kind: str, frames: ArrayLike | slice, columns: Sequence[ArrayLike], rows: ArrayLike
    ) -> None:
        """Add an item of some kind to some frames.

        Args:
            kind: One of those that the compiled code draws.
            frames: Numbers of frames.
            columns: Number of the picture, x, y, and two more numbers, for all or for each frame.
            rows: First row, and the one after the last.
        """
        every = np.arange(self.num_frames)
        chosen = every[frames] if isinstance(frames, slice) else np.asarray(frames, np.intp)
        items = np.empty((len(chosen), 8), np.int32)
        items[:, 0] = _KIND[kind]
        for place, column in enumerate(columns, start=1):
            items[:, place] = column
        items[:, 6:] = rows
        self._items.append((chosen, items))
        self._is_listed = False

    def number(self, picture: Picture) -> int:
        """The number of a picture, which is handed over when it is used first."""
        key = id(picture)  # The picture is kept with its number, so nothing else gets this one.
        if key not in self._numbers:
            self._numbers[key] = picture, self._frames.add(picture)
        return self._numbers[key][1]

    def _list(self) -> None:
        """Sort the items by frame, what was added first below."""
        frames = np.concatenate([frames for frames, _ in self._items])
        items = np.concatenate([items for _, items in self._items])
        order = np.argsort(frames, kind="stable")
        ends = np.searchsorted(frames[order], np.arange(self.num_frames), side="right")
        self._frames.play(items[order], ends.astype(np.int64))
        self._is_listed = True


class Part:
    """Some rows of all frames; rows are counted from the first of them.

    `frames` says where something is drawn, every frame if it is left out; places are one for all of
    these frames or one for each.
    """

    def __init__(self, display: Display, top: int, bottom: int) -> None:
        """Rows of a display."""
        self._display, self._top = display, top
        self._rows = (top, bottom)
        self.height = bottom - top

    def _add(
        self, kind: str, frames: ArrayLike | slice, columns: Sequence[ArrayLike | int]
    ) -> None:
        self._display.add(kind, frames, columns, self._rows)

    def tile(
        self,
        tile: Tile,
        x: ArrayLike = 0,
        y: int = 0,
        *,
        columns: tuple[ArrayLike, ArrayLike] | None = None,
        frames: ArrayLike | slice = _EVERYTHING,
    ) -> None:
        """Copy a tile, or some of its columns.

        Args:
            tile: What to copy; lies wholly inside.
            x: Column of its left edge, even.
            y: Row of its upper edge, even.
            columns: First column and the one after the last, even.
            frames: On which frames.
        """
        first, last = columns or (0, tile.size[0])
        count = np.subtract(last, first)
        number = self._display.number(tile)
        self._add("tile", frames, (number, x, y + self._top, first, count))

    def sprite(
        self,
        sprite: Sprite,
        x: ArrayLike,
        y: ArrayLike,
        *,
        frames: ArrayLike | slice = _EVERYTHING,
    ) -> None:
        """Put a sprite on a place, even in both directions; what lies outside is cut off."""
        number = self._display.number(sprite)
        self._add("sprite", frames, (number, x, np.add(y, self._top), 0, 0))

    def sprites(
        self,
        sprites: Sequence[Sprite],
        which: NDArray[np.intp],
        x: ArrayLike,
        y: ArrayLike,
        *,
        frames: ArrayLike,
    ) -> None:
        """Put on each of some frames the one of several sprites that is meant by its place."""
        numbers = np.array([self._display.number(sprite) for sprite in sprites], np.int32)
        self._add("sprite", frames, (numbers[which], x, np.add(y, self._top), 0, 0))

    def texture(
        self,
        texture: Texture,
        x: ArrayLike,
        y: ArrayLike,
        angle: ArrayLike = 0.0,
        *,
        frames: ArrayLike | slice = _EVERYTHING,
    ) -> None:
        """Put a sheet, turned about its origin, on a place.

        Args:
            texture: The sheet.
            x: Column of its origin, fractions allowed [px].
            y: Row of its origin [px].
            angle: Anticlockwise [rad].
            frames: On which frames.
        """
        fine = texture.fine
        is_straight = np.abs(angle) * texture.width < 2.0 * fine * _STRAIGHT
        turned = np.where(is_straight, 0.0, np.rint(np.divide(angle, _TURN)) * _TURN)
        columns = (
            self._display.number(texture),
            np.rint(np.multiply(x, fine)),
            np.rint(np.add(y, self._top) * fine),
            np.rint(_ONE * np.cos(turned)),
            np.rint(_ONE * np.sin(turned)),
        )
        self._add("texture", frames, columns)

    def veil(
        self, veil: Veil, first: ArrayLike = 0, *, frames: ArrayLike | slice = _EVERYTHING
    ) -> None:
        """Lay the columns of a veil, from an even one on, over everything."""
        self._add("veil", frames, (self._display.number(veil), 0, 0, first, 0))

    def light(
        self,
        light: Light,
        x: ArrayLike,
        y: ArrayLike,
        *,
        frames: ArrayLike | slice = _EVERYTHING,
    ) -> None:
        """Let a light shine in the next night, its origin at a column and a row."""
        number = self._display.number(light.picture)
        left = np.rint(np.multiply(0.5, x)) + light.left
        top = np.rint(np.multiply(0.5, y)) + light.top + self._top // 2
        self._add("light", frames, (number, left, top, 0, 0))

    def night(
        self,
        veil: Veil | None = None,
        first: ArrayLike = 0,
        *,
        frames: ArrayLike | slice = _EVERYTHING,
    ) -> None:
        """Darken everything where no light falls, and lay a veil over it in the same pass."""
        number = _NONE if veil is None else self._display.number(veil)
        self._add("night", frames, (number, 0, 0, 0 if veil is None else first, 0))

    def rain(self, streaks: Streaks, *, frames: ArrayLike | slice = _EVERYTHING) -> None:
        """Draw a picture of rain where it is brighter than what is there."""
        self._add("streaks", frames, (self._display.number(streaks), 0, 0, 0, 0))
