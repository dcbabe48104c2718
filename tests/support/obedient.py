"""A worker module for tests: it does what each message says."""

from __future__ import annotations

import os
import sys
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from overtaking.core.worker_process import ParentConnection


def main(parent: ParentConnection, *arguments: str) -> None:
    parent.send(arguments)
    for message in parent:
        match message:
            case "hang":
                parent.send("hanging")
                time.sleep(3600.0)
            case "environment":
                parent.send(dict(os.environ))
            case "print":
                print("a word of its own " * 1000)
                os.write(1, b"\x04\x00\x00\x00junk" * 10_000)
                parent.send(sys.stdin.read())
            case ("exit", int(status), str(text)):
                print(text, file=sys.stderr, flush=True)
                os._exit(status)
            case _:
                parent.send(message)
