"""Processors, threads, memory and time that this process or a query may use."""

from __future__ import annotations

import errno
import os
import re
import sys
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from overtaking.core.errors import ConfigError, OvertakingError, SystemLimitError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator


THREADS_VARIABLE = "RAYON_NUM_THREADS"
"""Environment variable with the largest number of threads of the engine."""

CGROUP_QUOTA_FILE = Path("/sys/fs/cgroup/cpu.max")
"""Linux's file with the CPU quota of a container: microseconds of quota and of its period.

Only this file of cgroups of version 2 is read, while `_memory_of_cgroups` reads both versions and
all parents: a process that overlooks a quota runs slower, a process that overlooks a limit of
memory is killed."""


def available_processors() -> int:
    """Number of processors that the system lets this process use."""
    num_installed = os.cpu_count() or 1
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else num_installed
    with suppress(OSError, ValueError):  # No container, or a container without a limit.
        time, period = CGROUP_QUOTA_FILE.read_text(encoding="ascii").split()
        return max(1, min(allowed, int(time) // int(period)))
    return allowed


def processors_to_use() -> int:
    """Number of processors to use: the available ones, or fewer if `RAYON_NUM_THREADS` is lower."""
    setting = os.environ.get(THREADS_VARIABLE, "")
    limit = int(setting) if setting.isascii() and setting.isdigit() else 0
    return min(available_processors(), limit) if limit else available_processors()


_MIB = 1 << 20  # Bytes.

LIBRARY_BYTES = 320 * _MIB
"""Address space of NumPy, Arrow and the engine once they are loaded: 290 MiB with NumPy 2.4 and
Arrow 26 on Linux."""

WORKING_BYTES = 96 * _MIB
"""Address space for modules that are loaded on demand and for the data of a small call. C++ and
Rust end the process when they cannot allocate a few bytes, so a call begins only with this much.
The size is chosen: a larger one refuses more calls that would have succeeded, a smaller one lets
more calls end the process."""

_STACK_BYTES = 8 * _MIB
"""Address space of a thread's stack where `ulimit -s` sets no limit."""

_OTHER_THREADS = 9
"""Threads that do not depend on the number of processors: 8 that read files for Arrow, 1 that
cleans up for its allocator."""

_ADDRESS_SPACE, _DATA_AND_STACK = 0, 5
"""Columns of Linux's `/proc/self/statm`: address space, and private memory that can be written."""

_M_ARENA_MAX = -8  # Value of M_ARENA_MAX in glibc's malloc.h.
_MEMORY_ERRORS = (errno.ENOMEM,)
_THREAD_ERRORS = (errno.EAGAIN,)
_FILE_ERRORS = (errno.EMFILE, errno.ENFILE)

_THREAD_TEXTS = (
    "can't start new thread",  # Python
    "can't allocate lock",
    "Failed to launch worker thread",  # Arrow
    "Resource temporarily unavailable",
)

_MEMORY_TEXTS = (
    "failed to map segment",  # The dynamic loader, in an ImportError
    "annot allocate memory",  # The system, with "C" or "c"
    "bad_alloc",  # C++
    "bad allocation",
)

MORE_MEMORY = (
    "take fewer simulations at a time or fewer threads (RAYON_NUM_THREADS), or raise the limit "
    "(ulimit -v, memory of the container)"
)

MORE_THREADS = (
    "raise the limit of processes (ulimit -u, pids of the container) or of memory (ulimit -v), or "
    "take fewer threads (--threads, RAYON_NUM_THREADS)"
)
MORE_FILES = "raise the limit of open files (ulimit -n), or close some"


def check_address_space(where: str) -> None:
    """Refuse to begin a call if too little address space is left for libraries and threads.

    Without this check, C++ or Rust code ends the process when an allocation fails.

    Args:
        where: The function or command, for the message.

    Raises:
        SystemLimitError: The limit (`ulimit -v`) leaves too little.
    """
    limit = _address_space_limit()
    used = None if limit is None else _bytes_in_use(_ADDRESS_SPACE)
    if limit is None or used is None:
        return
    _reduce_reservations()
    # The package imports Arrow after NumPy and the engine.
    libraries = 0 if "pyarrow" in sys.modules else LIBRARY_BYTES
    required = libraries + WORKING_BYTES + _missing_threads() * _stack_bytes()
    if used + required > limit:
        raise SystemLimitError(
            what="memory",
            where=where,
            expected=f"at least {_size(required)} that can be allocated",
            got=f"{_size(max(0, limit - used))}, which the limit of {_size(limit)} leaves",
            next_step="raise the limit (ulimit -v, in KiB), or take fewer threads "
            "(RAYON_NUM_THREADS)",
        )


def check_memory(size: int, where: str, next_step: str) -> None:
    """Refuse work that needs more memory than the system grants to this process.

    Args:
        size: Memory that the work needs [bytes].
        where: The function that needs it.
        next_step: An alternative for the caller.

    Raises:
        SystemLimitError: The machine, a limit of the process or a limit of its cgroup leaves less.
    """
    for free, limit in _limits():
        if size > free:
            raise SystemLimitError(
                what="memory",
                where=where,
                expected=f"at most the {_size(free)} {limit}",
                got=f"work that needs {_size(size)}",
                next_step=next_step,
            )


def refusal_of(error: BaseException, where: str) -> SystemLimitError | None:
    """Translate an error that a limit of the system caused.

    Args:
        error: Any error.
        where: The function or file in which it was raised.

    Returns:
        The error to raise instead, with the limit and a next step; None for other causes.
    """
    if isinstance(error, OvertakingError):
        return None
    text = str(error)
    number = error.errno if isinstance(error, OSError) else None
    if isinstance(error, MemoryError) or number in _MEMORY_ERRORS:
        return memory_error(where, text)
    if number in _FILE_ERRORS:
        return SystemLimitError(
            what="open files",
            where=where,
            expected="a system that opens one more",
            got=text,
            next_step=MORE_FILES,
        )
    if number in _THREAD_ERRORS or any(part in text for part in _THREAD_TEXTS):
        return thread_error(where, text)
    if any(part in text for part in _MEMORY_TEXTS):
        return memory_error(where, text)
    return None


def asks_beyond_machine(error: BaseException) -> bool:
    """Whether a library failed to allocate more than the memory of this machine.

    A damaged file may state such a size as the length of its content. Then the file is the cause,
    not a limit of the system.
    """
    stated = re.search(r"of size (\d+)", str(error)) if isinstance(error, MemoryError) else None
    return stated is not None and int(stated[1]) > _machine_memory()


@contextmanager
def explain_refusals(where: str) -> Generator[None]:
    """Translate errors in the block that limits of the system cause, see `refusal_of`.

    Args:
        where: The function or file, for the message.

    Raises:
        SystemLimitError: Instead of an error that a limit caused.
    """
    try:
        yield
    except Exception as error:
        if (refusal := refusal_of(error, where)) is None:
            raise
        raise refusal from error


def memory_error(where: str, answer: str) -> SystemLimitError:
    """The error where the system grants no more memory.

    Args:
        where: The function or file that needs it.
        answer: Text of the error of the system or of a library.
    """
    return SystemLimitError(
        what="memory",
        where=where,
        expected="a system that grants more",
        got=answer or "no more",
        next_step=MORE_MEMORY,
    )


def thread_error(where: str, answer: str) -> SystemLimitError:
    """The error where the system starts no more threads or processes.

    Args:
        where: The function that needs them.
        answer: Text of the error of the system or of a library.
    """
    return SystemLimitError(
        what="threads",
        where=where,
        expected="a system that starts them",
        got=answer,
        next_step=MORE_THREADS,
    )


@cache
def _reduce_reservations() -> None:
    """Make allocators reserve less address space, for processes with a limit (`ulimit -v`).

    The limit includes reserved addresses that are never used. Arrow's allocator reserves 1 GiB at
    once, glibc 64 MiB for each thread, and OpenBLAS a buffer for each processor.
    """
    # For libraries that are not loaded yet, and for child processes, which have the same limit.
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("MALLOC_ARENA_MAX", "1")
    if (arrow := sys.modules.get("pyarrow")) is not None:
        arrow.set_memory_pool(arrow.system_memory_pool())
    import ctypes

    with suppress(AttributeError, OSError):  # C libraries other than glibc have no mallopt.
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, 1)


def _limits() -> Iterator[tuple[int, str]]:
    """Memory that each limit leaves to this process [bytes], and its description for messages.

    The machine counts with all its memory, because other processes may free theirs.
    """
    # Linux grants more memory than the machine has, and ends the process when it is used. Windows
    # refuses such an allocation itself.
    if hasattr(os, "sysconf"):
        yield _machine_memory(), "of this machine"
    limit = _address_space_limit()
    if limit is not None and (used := _bytes_in_use(_ADDRESS_SPACE)) is not None:
        # `WORKING_BYTES` includes mapped files of modules, which only this limit counts.
        free = max(0, limit - used - WORKING_BYTES)
        yield free, f"that the limit of {_size(limit)} leaves (ulimit -v)"
    limit = _soft_limit("RLIMIT_DATA")
    if limit is not None and (used := _bytes_in_use(_DATA_AND_STACK)) is not None:
        yield max(0, limit - used), f"that the limit of {_size(limit)} leaves (ulimit -d)"
    for limit, used in _cgroup_memory():
        yield max(0, limit - used), f"that the limit of {_size(limit)} of its cgroup leaves"


def _machine_memory() -> int:
    """Memory of this machine [bytes]; on Windows 64 TiB, so that no size exceeds it."""
    if not hasattr(os, "sysconf"):
        return 1 << 46
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def _soft_limit(name: str) -> int | None:
    """Soft limit of this process by its name in `resource`; None without a limit."""
    try:
        import resource
    except ImportError:  # Windows.
        return None
    limit = resource.getrlimit(getattr(resource, name))[0]
    return None if limit == resource.RLIM_INFINITY else limit


def _address_space_limit() -> int | None:
    """Limit of the address space [bytes]; None without a limit."""
    return _soft_limit("RLIMIT_AS")


def _bytes_in_use(column: int) -> int | None:
    """Memory that this process uses now [bytes]; None on systems without `/proc`.

    Args:
        column: `_ADDRESS_SPACE` or `_DATA_AND_STACK`.
    """
    with suppress(OSError, ValueError, IndexError):
        columns = Path("/proc/self/statm").read_text(encoding="ascii").split()
        return int(columns[column]) * os.sysconf("SC_PAGE_SIZE")
    return None


def _missing_threads() -> int:
    """Number of threads that the engine and Arrow have yet to start."""
    # The size of Arrow's thread pool is this variable, or else the number of processors.
    setting = os.environ.get("OMP_NUM_THREADS", "")
    is_number = setting.isascii() and setting.isdigit()
    arrow_threads = int(setting) if is_number else available_processors()
    expected = processors_to_use() + arrow_threads + _OTHER_THREADS
    with suppress(OSError):
        return max(0, expected - len(list(Path("/proc/self/task").iterdir())))
    return expected


def _stack_bytes() -> int:
    """Address space of a thread's stack: the limit of stacks (`ulimit -s`), at most 16 MiB.

    The limit holds for Arrow's threads. The engine's threads take 2 MiB whatever the limit is, so a
    very large limit would count too much; the bound of 16 MiB is chosen.
    """
    return min(_soft_limit("RLIMIT_STACK") or _STACK_BYTES, 2 * _STACK_BYTES)


def _cgroup_memory() -> Iterator[tuple[int, int]]:
    """Limit and use [bytes] of the cgroups of this process that limit memory, on Linux only."""
    yield from _memory_of_cgroups(Path("/proc/self/cgroup"), Path("/sys/fs/cgroup"))


def _memory_of_cgroups(groups: Path, mount: Path) -> Iterator[tuple[int, int]]:
    """Limit and use [bytes] of the groups in a file and of their parents.

    The page cache does not count as use, because the kernel drops it first. In a container the file
    may name groups of the host, whose folders do not exist inside; then the container's own group
    is at the mount.

    Args:
        groups: File in the format of `/proc/self/cgroup`.
        mount: Folder of the cgroup file system.
    """
    with suppress(OSError, ValueError):  # Also lines of another form, and other encodings.
        lines = groups.read_text(encoding="utf-8", errors="surrogateescape").splitlines()
        for line in lines:
            _, controllers, name = line.split(":", 2)
            if not controllers:  # Version 2.
                root, files = mount, ("memory.max", "anon")
            elif "memory" in controllers.split(","):
                root, files = mount / "memory", ("memory.limit_in_bytes", "total_rss")
            else:
                continue
            folder = root / name.lstrip("/")
            for group in (folder, *folder.parents):
                yield from _group_memory(group, *files)
                if group == root:
                    break


def _group_memory(group: Path, limit_file: str, use_key: str) -> Iterator[tuple[int, int]]:
    """Limit and use of one group [bytes]; empty if the group does not limit memory."""
    with suppress(OSError, ValueError, KeyError):
        limit = int((group / limit_file).read_text(encoding="ascii"))  # Without a limit: "max".
        pairs = (line.split() for line in (group / "memory.stat").read_text().splitlines())
        yield limit, int(dict(pairs)[use_key])


def _size(size: int) -> str:
    """A number of bytes for messages."""
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"


def limit_process(
    memory_mib: int, *, open_files: int | None = None, processor_s: int | None = None
) -> None:
    """Forbid this process to write files, and limit its memory.

    Linux has all of these limits. macOS does not limit memory, and Windows has no such limits.

    Args:
        memory_mib: Memory in addition to the present use [MiB].
        open_files: Largest number of open files; None for no limit.
        processor_s: Processor time after which SIGXCPU ends the process [s]; None for no limit.
    """
    try:
        import resource
    except ImportError:  # Windows.
        return
    # RLIMIT_DATA counts private writable memory. RLIMIT_AS would also count addresses that threads
    # reserve and never use.
    memory = (_bytes_in_use(_DATA_AND_STACK) or 0) + memory_mib * _MIB
    limits = {
        resource.RLIMIT_DATA: (memory, memory),
        resource.RLIMIT_FSIZE: (0, 0),
        resource.RLIMIT_CORE: (0, 0),
    }
    if open_files is not None:
        limits[resource.RLIMIT_NOFILE] = (open_files, open_files)
    if processor_s is not None:
        # The kernel sends SIGXCPU at the soft limit and SIGKILL at the hard one. With equal limits
        # it sends SIGKILL, and the parent cannot tell why the process ended.
        limits[resource.RLIMIT_CPU] = (processor_s, processor_s + 1)
    for limit, soft_and_hard in limits.items():
        with suppress(ValueError, OSError):
            resource.setrlimit(limit, soft_and_hard)


def check_query_limits(where: str, *, max_rows: int, timeout_s: float, memory_mib: int) -> None:
    """Refuse limits under which no query can be answered.

    Args:
        where: The command of the query, for the message.
        max_rows: Largest number of rows of an answer, 1 to 1e9.
        timeout_s: Longest time [s], 0.001 to 1e9.
        memory_mib: Largest memory [MiB], 16 to 1e9.

    Raises:
        ConfigError: A limit is out of its range.
    """
    for name, value, low in (
        ("rows", max_rows, 1),
        ("time in seconds", timeout_s, 0.001),
        ("memory in MiB", memory_mib, 16),
    ):
        if not low <= value <= 1e9:
            raise ConfigError.out_of_range(what=name, where=where, low=low, got=value)


ANSWER_MEMORY_SHARE = 8
"""An answer may use this fraction of the memory, an eighth: the parent process stores it beside the
text that it formats."""


def remaining_answer_bytes(remaining: int | None, rows: object, where: str, memory_mib: int) -> int:
    """Subtract further rows of an answer from the memory that is left for it [bytes].

    Args:
        remaining: Memory that is left before these rows [bytes]; None for the first rows.
        rows: The rows.
        where: The command of the query, for the message.
        memory_mib: Largest memory of the query [MiB].

    Returns:
        Memory that is left after these rows [bytes].

    Raises:
        ConfigError: The answer is too large.
    """
    max_mib = memory_mib / ANSWER_MEMORY_SHARE
    remaining = int(max_mib * _MIB) if remaining is None else remaining
    remaining -= deep_size(rows)
    if remaining < 0:
        expected = f"an answer of at most {max_mib:g} MiB, 1/{ANSWER_MEMORY_SHARE} of the memory"
        raise query_limit_error(where, expected, "a larger one")
    return remaining


def query_limit_error(where: str, expected: str, got: str) -> ConfigError:
    """The error for a query that exceeds one of its limits."""
    return ConfigError(
        what="query",
        where=where,
        expected=expected,
        got=got,
        next_step="ask for less, or allow more (--memory, --timeout)",
    )


def deep_size(value: Any) -> int:
    """Memory of a value of an answer and of its elements [bytes]."""
    elements = value.values() if isinstance(value, dict) else value
    size = sum(map(deep_size, elements)) if isinstance(value, dict | list | tuple) else 0
    return sys.getsizeof(value) + size


A = TypeVar("A")
B = TypeVar("B")


def thread_pool(name: str, threads: int) -> ThreadPoolExecutor:
    """A pool of threads that lasts as long as the process.

    Allocators keep memory for each thread that has existed: with new threads for every shard it
    would grow with the number of shards.

    Args:
        name: Purpose of the pool. Each name and number of threads has one pool.
        threads: Number of threads.
    """
    return _process_pool(os.getpid(), name, threads)


@cache
def _process_pool(process: int, name: str, threads: int) -> ThreadPoolExecutor:
    """The pool of one process: a forked child does not inherit the threads of its parent."""
    del process  # Only part of the key of the cache.
    return ThreadPoolExecutor(max_workers=threads, thread_name_prefix=f"overtaking-{name}")


def submit(pool: ThreadPoolExecutor, work: Callable[[A], B], item: A) -> Future[B]:
    """Submit work to a pool from `thread_pool`.

    Raises:
        SystemLimitError: The system starts no more threads. The pool has then carried out or
            dropped all its work, and the next call of `thread_pool` returns a new pool.
    """
    try:
        return pool.submit(work, item)
    except RuntimeError as error:
        if (refusal := refusal_of(error, "overtaking")) is None:
            raise
        # A cache drops all its entries or none. The other pools go on for their present callers;
        # later callers get new ones.
        _process_pool.cache_clear()
        # The pool has kept the work whose thread did not start: its other threads, if any, do it.
        pool.shutdown()
        raise refusal from error


def ordered_map(work: Callable[[A], B], items: Iterable[A], threads: int) -> Generator[B]:
    """Call a function with each item in threads, and return the results in order.

    Threads suffice, because NumPy and the engine release the interpreter lock while they compute.
    At most `threads` + 1 items are under way or wait for the caller, so that memory does not grow
    with their number. The one above `threads` keeps the last thread busy while the caller waits for
    the first result.

    Args:
        work: The function. Its result must not depend on earlier items.
        items: The items.
        threads: Number of threads; 1 calls the function in this thread.

    Yields:
        The result of each item.
    """
    if threads == 1:
        yield from map(work, items)
        return
    pool = thread_pool("work", threads)
    underway: deque[Future[B]] = deque()
    try:
        for item in items:
            underway.append(submit(pool, work, item))
            if len(underway) > threads:
                yield underway.popleft().result()
        while underway:
            yield underway.popleft().result()
    finally:
        for future in underway:
            future.cancel()
        wait(underway)
