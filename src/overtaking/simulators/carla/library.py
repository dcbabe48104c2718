"""CARLA's client: where it is, which server it talks to, and which version both must be."""

import importlib
import os
import time
from dataclasses import dataclass
from importlib import metadata
from typing import Any

from overtaking.core.errors import ConfigError, MissingExtraError

VERSION = "0.9.16"
"""The only version of client and server whose behaviour is known here."""

SERVER_VARIABLE = "OVERTAKING_CARLA"
"""Environment variable with the server to use: `HOST:PORT`, or `headless` for one of our own."""

HEADLESS = "headless"
CALL_TIME = 10.0
"""A call that takes longer has failed [s]."""

LOAD_TIME = 120.0
"""The same for one that loads a map [s]."""


@dataclass(frozen=True, slots=True)
class Address:
    """Where a server is."""

    host: str
    port: int


def library() -> Any:
    """The module `carla`.

    Raises:
        MissingExtraError: It is not installed, or of another version.
    """
    try:
        found = metadata.version("carla")
        module = importlib.import_module("carla")
    except (ImportError, metadata.PackageNotFoundError):
        raise _missing("none") from None
    if found != VERSION:
        raise _missing(found)
    return module


def _missing(got: str) -> MissingExtraError:
    return MissingExtraError.for_extra(
        "carla",
        what=f"carla=={VERSION}, for Python 3.10 to 3.12 on Linux and Windows",
        where="the simulator CARLA",
        got=got,
    )


def chosen_server() -> str:
    """The server that `OVERTAKING_CARLA` names, `headless` by default."""
    return os.environ.get(SERVER_VARIABLE, "").strip() or HEADLESS


def parse_address(text: str) -> Address:
    """A server from `HOST:PORT`, `HOST` or `:PORT`.

    Raises:
        ConfigError: It is none of these.
    """
    host, _, port = text.rpartition(":") if ":" in text else (text, "", "2000")
    if not port.isdecimal() or not 0 < int(port) < 65536:
        raise ConfigError(
            what="server",
            where="--server",
            expected="HOST:PORT, or headless",
            got=repr(text),
            next_step="write it like --server localhost:2000",
        )
    return Address(host or "127.0.0.1", int(port))


def connect(carla: Any, address: Address, *, patience: float = 5.0) -> Any:
    """A client of a server that answers and is of the right version.

    Args:
        carla: The module.
        address: Where the server is.
        patience: For how long a server that is still starting is waited for [s].

    Raises:
        ConfigError: No server answers there, or one of another version.
    """
    where = f"{address.host}:{address.port}"
    client = carla.Client(address.host, address.port)
    begin = time.monotonic()
    while True:
        client.set_timeout(2.0)
        try:
            found = client.get_server_version()
            break
        except RuntimeError as error:
            if time.monotonic() - begin > patience:
                raise ConfigError(
                    what="CARLA server",
                    where=where,
                    expected=f"a server of CARLA {VERSION}",
                    got=str(error),
                    next_step="start one there, or leave --server out to use the headless one",
                ) from None
            time.sleep(0.2)
    if found != VERSION:
        raise ConfigError(
            what="version of the CARLA server",
            where=where,
            expected=VERSION,
            got=found,
            next_step=f"start a server of CARLA {VERSION}",
        )
    client.set_timeout(CALL_TIME)
    return client
