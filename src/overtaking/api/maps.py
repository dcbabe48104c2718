"""Maps of others: find the roads of an OpenDRIVE file that can be simulated."""

from overtaking.recordings.opendrive_map import list_opendrive_roads

__all__ = ["list_opendrive_roads"]
