"""A headless server for the process that starts it: on free ports, and gone when that is gone.

Run as `python -m overtaking.carla_server.child`, it prints the ports of calls and streams as JSON
when it is ready, and ends when its standard input does, however its parent came to its end.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading

from overtaking.carla_server.running import run_server


def main() -> None:
    """Serve until the parent is gone."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    run_server(port=0, ready=_tell, log=_ignore)


def _end_with_parent() -> None:
    while sys.stdin.buffer.read(1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)


def _tell(port: int, streams: int) -> None:
    print(json.dumps({"port": port, "stream_port": streams}), flush=True)


def _ignore(_: str) -> None:
    """Nobody reads it."""


if __name__ == "__main__":
    main()
