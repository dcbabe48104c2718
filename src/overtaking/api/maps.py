"""Maps of others: find the roads of an OpenDRIVE file that can be simulated."""

from collections.abc import Sequence
from pathlib import Path

from overtaking.model.checks import argument
from overtaking.recordings.opendrive_map import MappedRoad, map_roads

__all__ = ["map_roads", "plot_map"]


def plot_map(roads: Sequence[MappedRoad], out: str | Path) -> None:
    """Draw the roads of a map as a PNG or SVG file, by its name.

    Args:
        roads: What `map_roads` returned.
        out: The file, replaced as a whole.

    Raises:
        MissingExtraError: The extra `plots` is not installed.
        OSError: The file cannot be written.
    """
    from overtaking.show.plots.map import draw_map
    from overtaking.show.report.files import put_figure

    path = Path(argument(out, str | Path, "plot_map", "out"))
    drawing = draw_map(roads)
    put_figure(path, drawing)
