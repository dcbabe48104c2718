"""Throws damaged messages at the headless CARLA server, and sees whether it stays up and as small.

    python benchmarks/carla_fuzz.py --messages 100000

Genuine messages of every call are damaged (bytes changed, cut, doubled, swapped) and sent on
connections that are closed in the middle, a few to each. In between a sound call is made. Exits
with 1 if the server ends, does not answer, or grows by more than the limit.
"""

import argparse
import importlib
import random
import socket
import sys
import time
from contextlib import suppress
from typing import Any

from measure import ROOT
from overtaking.simulators.carla_server.calls import CALLS
from overtaking.simulators.carla_server.wire import Decoder, encode

sys.path.insert(0, str(ROOT))
support: Any = importlib.import_module("tests.support.carla")

MOST_GROWTH_KB = 30_000
"""A server that grows by more from the first tenth of the messages to the last leaks [KiB]."""

SETTLED_SHARE = 0.1
PIECE = 500
"""Messages between two sound calls."""

NAMES = sorted(CALLS)
_POSE = [[300.0, 244.0, 0.3], [0.0, 0.0, 0.0]]
_PEDALS = [0.5, 0.1, 0.0, False, False, False, 0]
_CAR = [1, "vehicle.audi.a2", [["role_name", 4, "hero"], ["color", 5, "1,2,3"]]]
_CAMERA = [43, "sensor.camera.rgb", [["image_size_x", 2, "64"], ["image_size_y", 2, "64"]]]
_ARGUMENTS = (
    [],
    [21],
    [[21, 22]],
    ["Town06"],
    ["Town06", True, 65535],
    [21, _POSE],
    [21, [1.0, 2.0, 3.0]],
    [21, True],
    [21, _PEDALS],
    [21, [3]],
    [_CAR, _POSE],
    [_CAMERA, _POSE, 21, 0, ""],
    [[50.0] * 14],
    [[True, False, [True, 0.05], True, 0.01, 10, 0.0, True, 3000.0, 2000.0, True]],
    [[[[2, [21, _PEDALS]]], [[1, [22]]], [[0, [_CAR, _POSE, [False], 0, "", []]]]], False],
    [["127.0.0.1", 8000]],
)


def genuine(chance: random.Random) -> bytes:
    """A call that a client could make."""
    name = chance.choice(NAMES)
    arguments = chance.choice(_ARGUMENTS)
    return encode([0, chance.randrange(1 << 16), name, [[chance.random() < 0.5], *arguments]])


def damaged(chance: random.Random) -> bytes:
    """The same with something wrong, or nothing."""
    data = bytearray(genuine(chance))
    for _ in range(chance.randrange(4)):
        at = chance.randrange(len(data))
        match chance.randrange(4):
            case 0:
                data[at] = chance.randrange(256)
            case 1:
                del data[at : at + chance.randrange(1, 9)]
            case 2:
                data[at:at] = bytes(chance.randrange(256) for _ in range(chance.randrange(1, 9)))
            case _:
                data += genuine(chance)
        data = data or bytearray(b"\x00")
    return bytes(data)


def throw(port: int, data: bytes) -> None:
    """Send bytes on a connection of their own, and wait until the server is done with them."""
    plug = socket.create_connection(("127.0.0.1", port), timeout=20.0)
    with plug, suppress(ConnectionError):
        plug.sendall(data)
        plug.shutdown(socket.SHUT_WR)
        while plug.recv(1 << 16):
            pass


def answers(port: int) -> bool:
    """Whether a sound call is answered as it should be; the world is emptied on the way."""
    with socket.create_connection(("127.0.0.1", port), timeout=20.0) as plug:
        plug.sendall(encode([0, 1, "load_new_episode", [[False], "Town06", True, 0]]))
        plug.sendall(encode([0, 2, "version", [[False]]]))
        decoder, found = Decoder(), list[object]()
        while len(found) < 2:
            found += decoder.feed(plug.recv(1 << 16))
    return found == [[1, 1, None, [[False]]], [1, 2, None, [[1, "0.9.16"]]]]


def fuzz(address: Any, count: int, seed: int) -> list[int]:
    """Memory of the server after each piece of messages [KiB]; empty if it did not answer."""
    chance, sizes = random.Random(seed), list[int]()
    for piece in range(count // PIECE):
        left = PIECE
        while left > 0:
            together = min(chance.randrange(1, 9), left)
            throw(address.port, b"".join(damaged(chance) for _ in range(together)))
            left -= together
        if not answers(address.port):
            return []
        sizes.append(support.memory_kb(address.process))
        if piece % 20 == 19:
            print(f"{(piece + 1) * PIECE:8d} messages, {sizes[-1] / 1024:6.1f} MB", flush=True)
    return sizes


def main() -> int:
    """Fuzz, and say what came of it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--messages", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    begin = time.monotonic()
    with support.headless_server() as address:
        sizes = fuzz(address, arguments.messages, arguments.seed)
    if not sizes:
        print("the server did not answer a sound call")
        return 1
    settled = sizes[int(len(sizes) * SETTLED_SHARE)]
    growth = sizes[-1] - settled
    print(
        f"{arguments.messages} messages in {time.monotonic() - begin:.0f} s: the server is up, "
        f"{settled / 1024:.1f} MB after a tenth, {sizes[-1] / 1024:.1f} MB at the end"
    )
    return int(growth > MOST_GROWTH_KB)


if __name__ == "__main__":
    sys.exit(main())
