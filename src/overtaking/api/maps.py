"""Maps of others: find the roads of an OpenDRIVE file that can be simulated."""

from overtaking.recordings.opendrive_map import map_roads

__all__ = ["map_roads"]
