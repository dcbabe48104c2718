"""Makes a data set in a store that speaks the protocol of S3, and compares it with a folder.

The server (moto) and the client (s3fs) have an environment of their own, beside this package:

    python -m venv build/stores
    build/stores/bin/python -m pip install '.[cloud]' s3fs==2026.9.0 'moto[server]==5.2.5'
    build/stores/bin/python benchmarks/oracles/stores.py

The run is stopped after each shard in turn and gone on with, an object is damaged, another is
removed, and two processes begin at once. The script ends with an error where the store does not
hold the bytes of the folder in the end, or where the second process is not refused.
"""

from __future__ import annotations

import argparse
import importlib
import logging
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import overtaking as ot
from overtaking.core.errors import DatasetError
from overtaking.data.store import Store

BUCKET = "overtaking"
SHARD_SIZE = 32
ACCESS = {
    "AWS_ACCESS_KEY_ID": "anyone",
    "AWS_SECRET_ACCESS_KEY": "anything",
    "AWS_DEFAULT_REGION": "us-east-1",
}


class Stopped(BaseException):
    """The run was stopped on purpose."""


def generate(out: str | Path, simulations: int, stop_after: int = 0) -> ot.Dataset:
    """Make the data set, or go on with it."""

    def progress(done: int, _: int) -> None:
        if stop_after and done >= stop_after:
            raise Stopped

    return ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=simulations,
        seed=1,
        out=out,
        shard_size=SHARD_SIZE,
        resume=True,
        progress=progress,
    )


def differences(url: str, folder: Path) -> list[str]:
    """What the store has not, has otherwise, or has beside the files of the folder."""
    store = Store(url)
    files: Any = importlib.import_module("s3fs").S3FileSystem()
    root = url.removeprefix("s3://")
    found = {path.removeprefix(f"{root}/") for path in files.find(root)}
    names = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    names -= {".lock"}
    wrong = [f"only in one of them: {name}" for name in sorted(found ^ names)]
    for name in sorted(found & names - {"dataset.json"}):
        with store.open(name) as file:
            if file.read() != (folder / name).read_bytes():
                wrong.append(f"other bytes: {name}")
    return wrong


def is_second_refused(url: str) -> bool:
    """Whether the store itself refuses a second writer that wants to be first."""
    place = Store(url)
    place.put_text("dataset.json", "first", is_first=True)
    try:
        place.put_text("dataset.json", "second", is_first=True)
    except FileExistsError:
        return True
    return False


def compare(simulations: int, folder: Path) -> list[str]:
    """Everything that the first lines of this file promise; what is wrong."""
    generate(folder, simulations)
    url = f"s3://{BUCKET}/data"
    for stop_after in range(SHARD_SIZE, simulations, SHARD_SIZE):
        try:
            generate(url, simulations, stop_after)
        except Stopped:
            continue
    generate(url, simulations).verify()
    wrong = differences(url, folder)
    store = Store(url)
    store.put_text("labels/part-00000.parquet", "damaged")
    try:
        ot.load_dataset(url).verify()
        wrong.append("damage was not noticed")
    except DatasetError as error:
        print(f"as it should be: {error}")
    generate(url, simulations)
    wrong += differences(url, folder)
    if not is_second_refused(f"s3://{BUCKET}/other"):
        wrong.append("two writers were first")
    return wrong


def main() -> int:
    """Start a server, compare, print what came of it."""
    parser = argparse.ArgumentParser(description="Compare a store with a folder.")
    parser.add_argument("--simulations", type=int, default=100)
    given = parser.parse_args()
    moto: Any = importlib.import_module("moto.server")
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    server = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    server.start()
    host, port = server.get_host_and_port()
    os.environ.update({**ACCESS, "AWS_ENDPOINT_URL": f"http://{host}:{port}"})
    try:
        importlib.import_module("s3fs").S3FileSystem().mkdir(BUCKET)
        with tempfile.TemporaryDirectory() as folder:
            wrong = compare(given.simulations, Path(folder) / "data")
    finally:
        server.stop()
    print("the store holds the bytes of the folder" if not wrong else "\n".join(wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
