"""libsumo as it is safe to use: found when it is asked for, by one simulation at a time.

libsumo is SUMO itself inside this process, with one world in global variables. A second
simulation, in another thread or in code around this package, would overwrite the first.
"""

import contextlib
import importlib
import io
import os
import threading
from collections.abc import Generator, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from overtaking.core.errors import ConfigError, MissingExtraError

DISTRIBUTION = "libsumo"

_ALONE = threading.Lock()
_TOUCHED = ("SUMO_HOME", "PROJ_LIB", "PROJ_DATA")
"""What the import of libsumo writes into the environment; other users of PROJ need their own."""


def library() -> Any:
    """The module `libsumo`.

    Raises:
        MissingExtraError: It is not installed.
    """
    before = {name: os.environ.get(name) for name in _TOUCHED}
    try:
        # It may print a warning about Arrow, which is none of SUMO's business here: no table is
        # ever read or written by it.
        with contextlib.redirect_stdout(io.StringIO()):
            return importlib.import_module(DISTRIBUTION)
    except ImportError as error:
        raise MissingExtraError.for_extra(
            "sumo", what=DISTRIBUTION, where="sumo", got=str(error)
        ) from None
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def library_version() -> str:
    """Version of the installed libsumo, or "missing"; does not load it."""
    try:
        return version(DISTRIBUTION)
    except PackageNotFoundError:
        return "missing"


@contextlib.contextmanager
def running(options: Sequence[str]) -> Generator[Any]:
    """SUMO with a network and its vehicles loaded, until the end of the context.

    Args:
        options: Options of `sumo`, without the name of the program.

    Yields:
        The module `libsumo`.

    Raises:
        MissingExtraError: It is not installed.
        ConfigError: It is in use already, or SUMO refuses the input.
    """
    sumo = library()
    if not _ALONE.acquire(blocking=False):
        raise _busy("another thread of overtaking")
    try:
        if sumo.isLoaded():
            raise _busy("a simulation that is open in this process")
        try:
            sumo.start([DISTRIBUTION, *options])
            yield sumo
        except (sumo.TraCIException, sumo.FatalTraCIError) as error:
            raise _refused(error) from None
        finally:
            # Also after a start that failed half-way, which would make the next one fail.
            with contextlib.suppress(sumo.TraCIException, sumo.FatalTraCIError):
                sumo.close()
    finally:
        _ALONE.release()


def _busy(by: str) -> ConfigError:
    return ConfigError(
        what=DISTRIBUTION,
        where="sumo",
        expected="one simulation at a time: SUMO has one world in each process",
        got=by,
        next_step="close it, or simulate in a process of its own",
    )


def _refused(error: Exception) -> ConfigError:
    return ConfigError(
        what="simulation",
        where=f"SUMO {library_version()}",
        expected="a scenario that SUMO can run",
        got=str(error),
        next_step="report it with the profile, the seed and the number of the simulation",
    )
