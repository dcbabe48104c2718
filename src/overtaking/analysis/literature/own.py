"""A data set of this package as a row of the table of data sets."""

from __future__ import annotations

from typing import TYPE_CHECKING

from overtaking.analysis.literature.records import DrivingDataset

if TYPE_CHECKING:
    from overtaking.data.load import Dataset

_MILLISECONDS_PER_HOUR = 3.6e6


def own_row(data: Dataset) -> DrivingDataset:
    """The row of a data set, from its manifest and its tables.

    Every frame holds position, heading and size of every vehicle: a box in three dimensions.
    Dawn stands, as the paper's horizon line does, for a sun that is low ahead.

    Args:
        data: The data set; what belongs to a whole table is read, never frames or states.
    """
    simulations, weather = data.table("simulations"), data.table("weather")
    num_frames = simulations["num_frames"].to_numpy().astype("int64")
    duration = num_frames * simulations["frame_interval_ms"].to_numpy()
    identity = data.manifest.identity
    num_classes = len(data.table("vehicles")["kind"].unique())
    is_so = {
        "night": weather["night"].to_numpy(zero_copy_only=False).any(),
        "rain": (weather["rain_percent"].to_numpy() > 0).any(),
        "snow": False,
        "dawn": weather["horizon_line"].to_numpy(zero_copy_only=False).any(),
    }
    return DrivingDataset(
        id=data.name,
        name=data.name,
        year=int(data.manifest.provenance.started[:4]),
        num_scenes=len(data),
        duration_h=float(duration.sum()) / _MILLISECONDS_PER_HOUR,
        num_images=0,
        num_lidar_clouds=0,
        num_radar_clouds=0,
        num_annotated_frames=int(num_frames.sum()),
        boxes_3d=True,
        num_map_layers=0,
        min_classes=num_classes,
        max_classes=num_classes,
        conditions=tuple(word for word, is_there in is_so.items() if is_there),
        locations=f"{'Recorded' if identity.source else 'Simulated'} on {identity.road.name}",
        sensors=(),
        traffic=("highway",),
        annotations=("3d",),
        reference="own",
        source="own",
    )
