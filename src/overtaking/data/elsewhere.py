"""What becomes of an order where it is carried out in another process."""

import dataclasses
import socket
from functools import cache

from overtaking.core.errors import DatasetError
from overtaking.data.manifest import read_manifest
from overtaking.data.orders import Order
from overtaking.data.place import Place, place_of


def single(order: Order) -> Order:
    """The order with one thread to simulate: there is a process for each core."""
    return dataclasses.replace(order, simulator=dataclasses.replace(order.simulator, threads=1))


def absolute(place: Place) -> str:
    """Where a place is, for processes that run elsewhere."""
    return str(place.resolved())


@cache
def seen(where: str, fingerprint: str) -> Place:
    """The place, if a worker sees the same one as the process that gave it the work.

    Args:
        where: What `absolute` said.
        fingerprint: Of the identity of the data set.

    Raises:
        DatasetError: Something else is there, or nothing.
    """
    place = place_of(where)
    try:
        found = read_manifest(place).identity.fingerprint
    except DatasetError:
        found = None
    if found == fingerprint:
        return place
    raise DatasetError.of(
        what="place",
        where=where,
        expected="one that every worker sees",
        got=f"{'nothing' if found is None else 'another data set'} there on {socket.gethostname()}",
        next_step="choose a folder that all machines share, or a store, such as s3://bucket/data",
    )
