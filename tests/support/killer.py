"""Kills workers while a data set is made, and compares whole folders."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import threading
import time
from pathlib import Path

from overtaking.data.location import PARTIAL


class Killer(threading.Thread):
    """Kills processes that have begun a shard and not finished it.

    Args:
        out: Folder of the data set.
        kills: How many to kill.
    """

    def __init__(self, out: Path, kills: int) -> None:
        super().__init__(daemon=True)
        self.out, self.kills = out, kills
        self.killed: dict[int, str] = {}
        self.is_over = False

    def __enter__(self) -> Killer:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.is_over = True
        self.join()

    def run(self) -> None:
        while len(self.killed) < self.kills and not self.is_over:
            for folder in self.out.glob(f"{PARTIAL}/*-*"):
                pid = int(folder.name.partition("-")[0])
                # A file that grows is that of a shard: whoever writes it is in the middle of it.
                if pid in (os.getpid(), *self.killed) or not any(folder.glob("*.parquet")):
                    continue
                self.killed[pid] = Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ")
                os.kill(pid, signal.SIGKILL)
                break
            time.sleep(0.002)


def contents(folder: Path) -> dict[str, str]:
    """A digest of every file of a data set, but for the times in its manifest.

    Whole files would make pytest compare them for minutes where they differ.
    """
    files = {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }
    manifest = json.loads(files["dataset.json"])
    del manifest["provenance"]
    files["dataset.json"] = json.dumps(manifest).encode()
    return {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
