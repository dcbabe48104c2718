"""Limits of processors, threads, memory and time: how much is left, and errors that name them.

The module has five parts:

- numbers of processors and threads to use;
- checks before a call: `check_address_space` for the libraries and threads of any call,
  `check_memory` for the arrays of a large one. Without them, compiled code would end the process
  when an allocation fails;
- the translation of errors that a limit caused into a `SystemLimitError` (`refusal_of`,
  `explain_refusals`). A refusal is such an error: the operating system refused memory, a thread, a
  process or an open file;
- limits for a child process that answers a query (a question in SQL or in logic), or that runs a
  file of unknown origin, such as a map or a neural network, so that it cannot harm the machine;
- pools of threads (`thread_pool`, `ordered_map`).
"""

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
"""Environment variable with the largest number of threads of the engine, the compiled simulator.
The name is fixed by Rayon, the Rust library that starts the threads."""

CGROUP_QUOTA_FILE = Path("/sys/fs/cgroup/cpu.max")
"""Linux's file with the processor time of a container: microseconds that all its processes may use
together in a period, or "max", and the microseconds of the period.

Linux calls the group of processes of a container a cgroup. Only cgroups of version 2 have this
file. In cgroups of version 1, the limit of processor time is not read, because a process that
ignores it only runs slower. Limits of memory are read in both versions (`_memory_of_cgroups`),
because a process that ignores them is killed."""


def available_processors() -> int:
    """Number of processors that the system lets this process use, 1 or more."""
    num_installed = os.cpu_count() or 1
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else num_installed
    with suppress(OSError, ValueError):  # No such file, or "max": no limit.
        quota, period = CGROUP_QUOTA_FILE.read_text(encoding="ascii").split()
        # Rounded down: with one more thread, Linux would pause all of them for part of each period.
        return max(1, min(allowed, int(quota) // int(period)))
    return allowed


def processors_to_use() -> int:
    """Number of processors to use: the available ones, or fewer if `RAYON_NUM_THREADS` is lower.

    A value of the variable that is 0 or not a number does not count.
    """
    setting = os.environ.get(THREADS_VARIABLE, "")
    limit = int(setting) if setting.isascii() and setting.isdigit() else 0
    return min(available_processors(), limit) if limit else available_processors()


_MIB = 1 << 20  # Bytes.

# A limit of the address space (`ulimit -v`) counts all addresses that a process has reserved, also
# without memory behind them.

LIBRARY_BYTES = 320 * _MIB
"""Address space that NumPy, Arrow and the engine take when they are loaded: 290 MiB with NumPy 2.4
and Arrow 26 on Linux, and a margin."""

WORKING_BYTES = 96 * _MIB
"""Address space for modules that are loaded on demand and for the data of a small call. C++ and
Rust end the process when they cannot allocate a few bytes, so a call begins only with this much.
Chosen: with more, calls that would have succeeded are refused; with less, more calls end the
process."""

_STACK_BYTES = 8 * _MIB
"""Address space of a thread's stack where `ulimit -s` sets no limit. Chosen: the usual limit, which
is more than the stacks of glibc take without a limit (2 MiB on x86-64)."""

_NUM_OTHER_THREADS = 9
"""Threads whose number does not depend on the processors: 8 that read files for Arrow, 1 that
cleans up for its allocator."""

_ADDRESS_SPACE, _DATA_AND_STACK = 0, 5
"""Columns of Linux's `/proc/self/statm`: address space, and private memory that can be written."""

# Option of `mallopt` in glibc's malloc.h: the number of arenas, from which threads take memory.
_M_ARENA_MAX = -8

# `refusal_of` recognizes an error that a limit caused by the `errno` of an OSError, or by a part of
# its text, because errors of libraries have no `errno`.
_MEMORY_ERRNOS = (errno.ENOMEM,)
_THREAD_ERRNOS = (errno.EAGAIN,)
_FILE_ERRNOS = (errno.EMFILE, errno.ENFILE)

_THREAD_TEXTS = (
    "can't start new thread",  # Python
    "can't allocate lock",  # Python
    "Failed to launch worker thread",  # Arrow
    "Resource temporarily unavailable",  # The system, EAGAIN in words
)

_MEMORY_TEXTS = (
    "failed to map segment",  # The dynamic loader, in an ImportError
    "annot allocate memory",  # The system, with "C" or "c"
    "bad_alloc",  # C++
    "bad allocation",  # C++ on Windows
)

# Advice to the user at the end of messages.
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

    Without a limit of the address space (`ulimit -v`) it does nothing.

    Args:
        where: The function or command, for the message.

    Raises:
        SystemLimitError: The limit leaves too little.
    """
    limit = _address_space_limit()
    if limit is None or (used := _bytes_in_use(_ADDRESS_SPACE)) is None:
        return
    _reduce_reservations()  # Now, before the call loads libraries and starts threads.
    # The package imports Arrow after NumPy and the engine: with Arrow, `used` includes all of them.
    libraries = 0 if "pyarrow" in sys.modules else LIBRARY_BYTES
    required = libraries + WORKING_BYTES + _missing_threads() * _stack_bytes()
    if used + required > limit:
        raise SystemLimitError(
            what="memory",
            where=where,
            expected=f"at least {_size_text(required)} that can be allocated",
            got=f"{_size_text(max(0, limit - used))}, "
            f"which the limit of {_size_text(limit)} leaves",
            next_step="raise the limit (ulimit -v, in KiB), or take fewer threads "
            "(RAYON_NUM_THREADS)",
        )


def check_memory(size: int, where: str, next_step: str) -> None:
    """Refuse work that needs more memory than the system grants to this process.

    Args:
        size: Memory that the work needs [bytes].
        where: The function that needs it, for the message.
        next_step: An alternative for the caller, as an imperative.

    Raises:
        SystemLimitError: The machine, a limit of the process or a limit of its cgroup leaves less.
    """
    for remaining, limit_text in _remaining_memory():
        if size > remaining:
            raise SystemLimitError(
                what="memory",
                where=where,
                expected=f"at most the {_size_text(remaining)} {limit_text}",
                got=f"work that needs {_size_text(size)}",
                next_step=next_step,
            )


def refusal_of(error: BaseException, where: str) -> SystemLimitError | None:
    """Translate an error into a `SystemLimitError` if a limit of the system caused it.

    Args:
        error: An error of Python, of the system or of a library.
        where: The function or file in which it was raised, for the message.

    Returns:
        The error to raise instead, which names the resource and a next step; None if the error has
        another cause.
    """
    if isinstance(error, OvertakingError):  # Its text may quote an error of the system.
        return None
    text = str(error)
    number = error.errno if isinstance(error, OSError) else None
    if isinstance(error, MemoryError) or number in _MEMORY_ERRNOS:
        return memory_error(where, text)
    if number in _FILE_ERRNOS:
        return SystemLimitError(
            what="open files",
            where=where,
            expected="a system that opens one more",
            got=text,
            next_step=MORE_FILES,
        )
    if number in _THREAD_ERRNOS or any(part in text for part in _THREAD_TEXTS):
        return thread_error(where, text)
    if any(part in text for part in _MEMORY_TEXTS):
        return memory_error(where, text)
    return None


def asks_beyond_machine(error: BaseException) -> bool:
    """Whether a library failed to allocate more than the whole memory of this machine.

    A damaged file may state such a size as the length of its content. Then the file is the cause,
    not a limit of the system.

    Args:
        error: The error. The `MemoryError` of Arrow states the size in its text.
    """
    stated = re.search(r"of size (\d+)", str(error)) if isinstance(error, MemoryError) else None
    return stated is not None and int(stated[1]) > _machine_memory()


@contextmanager
def explain_refusals(where: str) -> Generator[None]:
    """Translate errors in the block of `with` that a limit of the system caused.

    Args:
        where: The function or file, for the message.

    Raises:
        SystemLimitError: Instead of an error of which `refusal_of` finds that a limit caused it.
            Other errors pass.
    """
    try:
        yield
    except Exception as error:
        if (refusal := refusal_of(error, where)) is None:
            raise
        raise refusal from error


def memory_error(where: str, answer: str) -> SystemLimitError:
    """The error for a call to which the system grants no more memory.

    Args:
        where: The function or file that needs it.
        answer: Text of the original error of the system or a library; may be empty.
    """
    return SystemLimitError(
        what="memory",
        where=where,
        expected="a system that grants more",
        got=answer or "no more",
        next_step=MORE_MEMORY,
    )


def thread_error(where: str, answer: str) -> SystemLimitError:
    """The error for a call for which the system starts no more threads or processes.

    Args:
        where: The function that needs them.
        answer: Text of the original error of the system or a library.
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
    """Make allocators reserve less address space, in a process with a limit of it.

    Otherwise Arrow's allocator reserves 1 GiB at once, the C library 64 MiB for each thread, and
    OpenBLAS, which NumPy uses, a buffer for each processor. The cache of the function makes the
    second and later calls do nothing.
    """
    # The variables act on libraries that are loaded later, and on child processes, which have the
    # same limit. A variable that the user has set stays. The calls below act on loaded libraries.
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("MALLOC_ARENA_MAX", "1")
    if (arrow := sys.modules.get("pyarrow")) is not None:
        arrow.set_memory_pool(arrow.system_memory_pool())
    import ctypes

    with suppress(AttributeError, OSError):  # C libraries other than glibc have no mallopt.
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, 1)


def _remaining_memory() -> Iterator[tuple[int, str]]:
    """Memory that each limit leaves to this process [bytes], and words for the limit in a message.

    The words follow a size: "at most the 16.0 GB" "of this machine".
    """
    # Linux grants more memory than the machine has, and kills the process when it uses it. Windows,
    # which has no `sysconf`, refuses such an allocation itself. The limit is the whole memory, not
    # the free part, because other processes may free theirs.
    if hasattr(os, "sysconf"):
        yield _machine_memory(), "of this machine"
    limit = _address_space_limit()
    if limit is not None and (used := _bytes_in_use(_ADDRESS_SPACE)) is not None:
        # `WORKING_BYTES` is for the files of modules that the work will load: this limit counts
        # their addresses, the other limits do not. Libraries and threads that are still missing
        # are left out here, because `check_address_space` counted them at the start of the call.
        free = max(0, limit - used - WORKING_BYTES)
        yield free, f"that the limit of {_size_text(limit)} leaves (ulimit -v)"
    limit = _soft_limit("RLIMIT_DATA")
    if limit is not None and (used := _bytes_in_use(_DATA_AND_STACK)) is not None:
        yield max(0, limit - used), f"that the limit of {_size_text(limit)} leaves (ulimit -d)"
    for limit, used in _cgroup_memory():
        yield max(0, limit - used), f"that the limit of {_size_text(limit)} of its cgroup leaves"


def _machine_memory() -> int:
    """Memory of this machine [bytes]; on Windows 64 TiB, so that no size exceeds it."""
    if not hasattr(os, "sysconf"):
        return 1 << 46
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def _soft_limit(name: str) -> int | None:
    """Soft limit of this process, in the unit of the limit; None if the process has no such limit.

    Args:
        name: Name of the limit in the module `resource`, such as "RLIMIT_AS".
    """
    try:
        import resource
    except ImportError:  # Windows.
        return None
    limit = resource.getrlimit(getattr(resource, name))[0]
    return None if limit == resource.RLIM_INFINITY else limit


def _address_space_limit() -> int | None:
    """Limit of the address space of this process, `ulimit -v` [bytes]; None without a limit."""
    return _soft_limit("RLIMIT_AS")


def _bytes_in_use(column: int) -> int | None:
    """Memory that this process uses now [bytes]; None on systems without `/proc`.

    Args:
        column: The kind of memory, `_ADDRESS_SPACE` or `_DATA_AND_STACK`.
    """
    with suppress(OSError, ValueError, IndexError):
        columns = Path("/proc/self/statm").read_text(encoding="ascii").split()
        return int(columns[column]) * os.sysconf("SC_PAGE_SIZE")
    return None


def _missing_threads() -> int:
    """Number of threads that the engine and Arrow will start during a call but have not started.

    All threads of the process count as started by these two, because nothing tells them apart.
    Other threads, at least the main thread, make the result too small by their number.
    """
    # Arrow starts as many threads as this variable says; one for each processor if it is 0 or not a
    # number.
    setting = os.environ.get("OMP_NUM_THREADS", "")
    is_number = setting.isascii() and setting.isdigit()
    arrow_threads = (int(setting) if is_number else 0) or available_processors()
    expected = processors_to_use() + arrow_threads + _NUM_OTHER_THREADS
    with suppress(OSError):  # A system without `/proc`: count all threads as missing.
        return max(0, expected - len(list(Path("/proc/self/task").iterdir())))
    return expected


def _stack_bytes() -> int:
    """Address space that is counted for the stack of a new thread [bytes].

    A thread of Arrow takes the limit of stacks (`ulimit -s`), a thread of the engine 2 MiB. Both
    are counted with one size: the limit, but at most 16 MiB (chosen). Under a higher limit this is
    too small for Arrow's threads; but counting the full limit also for the engine's small stacks
    would refuse calls that succeed.
    """
    return min(_soft_limit("RLIMIT_STACK") or _STACK_BYTES, 2 * _STACK_BYTES)


def _cgroup_memory() -> Iterator[tuple[int, int]]:
    """Limit and use [bytes] of each cgroup of this process that limits memory.

    A cgroup is a group of processes with common limits, such as a container. Only Linux has them.
    """
    yield from _memory_of_cgroups(Path("/proc/self/cgroup"), Path("/sys/fs/cgroup"))


def _memory_of_cgroups(groups: Path, mount: Path) -> Iterator[tuple[int, int]]:
    """Limit and use [bytes] of the cgroups in a file and of their parents, which limit them too.

    Files that the system caches in memory do not count as use, because it drops them when a process
    needs memory. In a container, the file may name groups of the host, whose folders do not exist
    inside. The group of the container itself is then the root folder (`mount`, or `mount/memory` in
    version 1), the last parent that this function reads.

    Args:
        groups: File in the format of `/proc/self/cgroup`: lines `number:controllers:path`.
        mount: Folder in which each cgroup is a folder with files.
    """
    with suppress(OSError, ValueError):  # No such file, or lines of another form.
        lines = groups.read_text(encoding="utf-8", errors="surrogateescape").splitlines()
        for line in lines:
            _, controllers, name = line.split(":", 2)
            # The file with the limit, and the line of `memory.stat` with the memory in use that is
            # not a cached file.
            if not controllers:  # Version 2.
                root, limit_and_use = mount, ("memory.max", "anon")
            elif "memory" in controllers.split(","):
                root, limit_and_use = mount / "memory", ("memory.limit_in_bytes", "total_rss")
            else:
                continue
            folder = root / name.lstrip("/")
            for group in (folder, *folder.parents):
                yield from _group_memory(group, *limit_and_use)
                if group == root:
                    break


def _group_memory(group: Path, limit_file: str, use_key: str) -> Iterator[tuple[int, int]]:
    """Yield limit and use of a cgroup [bytes]; nothing if it does not limit memory.

    Args:
        group: Folder of the cgroup.
        limit_file: Name of the file with its limit.
        use_key: Name of the line in its file `memory.stat` that states the use.
    """
    with suppress(OSError, ValueError, KeyError):
        limit = int((group / limit_file).read_text(encoding="ascii"))  # Without a limit: "max".
        pairs = (line.split() for line in (group / "memory.stat").read_text().splitlines())
        yield limit, int(dict(pairs)[use_key])


def _size_text(size: int) -> str:
    """A number of bytes in words for messages: "1.5 GB", "200 MB"."""
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"


def limit_process(
    memory_mib: int, *, open_files: int | None = None, processor_s: int | None = None
) -> None:
    """Forbid this process to write files, and limit its memory, until its end.

    Child processes call it before they run a query, a neural network of a user or the reader of a
    map. Linux has all of these limits. macOS does not limit memory, and Windows has no such limits.

    Args:
        memory_mib: Memory in addition to the present use [MiB].
        open_files: Largest number of open files. Files that are open now stay open, also beyond it;
            None leaves the limit as it is.
        processor_s: Processor time after which SIGXCPU ends the process [s]; None leaves the limit
            as it is.
    """
    try:
        import resource
    except ImportError:  # Windows.
        return
    # RLIMIT_DATA counts private memory that can be written. RLIMIT_AS would also count addresses
    # that threads reserve and never use.
    # The 0 is for macOS, which has no /proc and does not limit memory.
    memory = (_bytes_in_use(_DATA_AND_STACK) or 0) + memory_mib * _MIB
    limits = {
        resource.RLIMIT_DATA: (memory, memory),
        resource.RLIMIT_FSIZE: (0, 0),  # Bytes of a file that it writes; pipes are not limited.
        resource.RLIMIT_CORE: (0, 0),  # No image of its memory on the disk when it crashes.
    }
    if open_files is not None:
        limits[resource.RLIMIT_NOFILE] = (open_files, open_files)
    if processor_s is not None:
        # The kernel sends SIGXCPU at the soft limit and SIGKILL at the hard one. With equal limits
        # it sends SIGKILL, and the parent cannot tell why the process ended.
        limits[resource.RLIMIT_CPU] = (processor_s, processor_s + 1)
    for limit, soft_and_hard in limits.items():
        with suppress(ValueError, OSError):  # The present limit is lower, or macOS refuses it.
            resource.setrlimit(limit, soft_and_hard)


def check_query_limits(where: str, *, max_rows: int, timeout_s: float, memory_mib: int) -> None:
    """Refuse limits of a query under which no query can be answered.

    Args:
        where: The command of the query, `sql` or `ask`, for the message.
        max_rows: Largest number of rows of an answer, 1 to 1e9.
        timeout_s: Longest time [s], 0.001 to 1e9.
        memory_mib: Largest memory of the process that answers [MiB], 16 to 1e9.

    Raises:
        ConfigError: A limit is out of its range.
    """
    # The ranges are chosen. 1e9 is beyond any machine, but keeps NaN and infinity out.
    for name, value, low in (
        ("rows", max_rows, 1),
        ("time in seconds", timeout_s, 0.001),
        ("memory in MiB", memory_mib, 16),
    ):
        if not low <= value <= 1e9:
            raise ConfigError.out_of_range(what=name, where=where, low=low, got=value)


_ANSWER_MEMORY_DIVISOR = 8
"""An answer may take the memory of its query divided by this number. Chosen: the process that asked
holds the answer several times, as rows and in the text that it formats."""


def remaining_answer_bytes(remaining: int | None, rows: object, where: str, memory_mib: int) -> int:
    """Subtract further rows of an answer from the memory that is left for the answer.

    Args:
        remaining: Result of the last call for this answer [bytes]; None at its first rows.
        rows: The further rows.
        where: The command of the query, for the message.
        memory_mib: Largest memory of the query [MiB].

    Returns:
        Memory that is left for the answer after these rows [bytes].

    Raises:
        ConfigError: The answer is too large.
    """
    max_mib = memory_mib / _ANSWER_MEMORY_DIVISOR
    remaining = int(max_mib * _MIB) if remaining is None else remaining
    remaining -= deep_size(rows)
    if remaining < 0:
        expected = f"an answer of at most {max_mib:g} MiB, 1/{_ANSWER_MEMORY_DIVISOR} of the memory"
        raise query_limit_error(where, expected, "a larger one")
    return remaining


def query_limit_error(where: str, expected: str, got: str) -> ConfigError:
    """The error for a query that exceeds a limit of time or memory.

    Args:
        where: The command of the query.
        expected: The limit in words, such as "an answer within 10 s".
        got: The query in words, such as "one that takes longer".
    """
    return ConfigError(
        what="query",
        where=where,
        expected=expected,
        got=got,
        next_step="ask for less, or allow more (--memory, --timeout)",
    )


def deep_size(value: Any) -> int:
    """Memory of a value and, if it is a collection, of its elements and theirs [bytes].

    Args:
        value: Rows of an answer: dicts, lists and tuples of texts and numbers.
    """
    elements = value.values() if isinstance(value, dict) else value
    size = sum(map(deep_size, elements)) if isinstance(value, dict | list | tuple) else 0
    return sys.getsizeof(value) + size


ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")


def thread_pool(name: str, threads: int) -> ThreadPoolExecutor:
    """A pool of threads that lasts as long as the process; the same arguments return the same pool.

    Allocators keep memory for each thread that has existed. With new threads for every shard (a
    file of a data set), this memory would grow with the number of shards.

    Args:
        name: Purpose of the pool, which becomes part of the names of its threads.
        threads: Number of threads.
    """
    return _process_pool(os.getpid(), name, threads)


@cache
def _process_pool(process: int, name: str, threads: int) -> ThreadPoolExecutor:
    """Make the pool for a process id, a name and a number of threads, or return the cached one.

    A forked child has a copy of the cache but not the threads of its parent, so it needs a pool of
    its own.
    """
    del process  # Only part of the key of the cache.
    return ThreadPoolExecutor(max_workers=threads, thread_name_prefix=f"overtaking-{name}")


def submit(
    pool: ThreadPoolExecutor, work: Callable[[ItemT], ResultT], item: ItemT
) -> Future[ResultT]:
    """Call a function with an item in a thread of a pool from `thread_pool`.

    Args:
        pool: The pool.
        work: The function.
        item: Its argument.

    Returns:
        The future result of the function.

    Raises:
        SystemLimitError: The system starts no more threads. The pool is then closed: its threads,
            if it has any, have done all queued work. `thread_pool` returns a new pool from now on.
    """
    try:
        return pool.submit(work, item)
    except RuntimeError as error:
        # The public function that the user called is not known here: the message names the package.
        if (refusal := refusal_of(error, "overtaking")) is None:
            raise
        # This drops all pools from the cache, because a single entry cannot be dropped. The present
        # callers of the other pools still hold them; later callers get new ones.
        _process_pool.cache_clear()
        # The pool has queued the work before it failed to start a thread for it. `shutdown` waits
        # until its other threads, if any, have done all queued work.
        pool.shutdown()
        raise refusal from error


def ordered_map(
    work: Callable[[ItemT], ResultT], items: Iterable[ItemT], threads: int
) -> Generator[ResultT]:
    """Call a function with each item in several threads, and yield the results in order.

    Threads suffice, because NumPy and the engine release the interpreter lock while they compute.
    At most `threads` + 1 items are underway, so that memory does not grow with the number of items:
    one for each thread, and one that waits, so that a thread has work when it finishes while the
    caller still waits for an earlier result.

    Args:
        work: The function. Its result must not depend on earlier items.
        items: The items.
        threads: Number of threads, 1 or more; 1 calls the function in the thread of the caller.

    Yields:
        The result of each item, in the order of the items.
    """
    if threads == 1:
        yield from map(work, items)
        return
    pool = thread_pool("work", threads)
    underway: deque[Future[ResultT]] = deque()
    try:
        for item in items:
            underway.append(submit(pool, work, item))
            if len(underway) > threads:
                yield underway.popleft().result()
        while underway:
            yield underway.popleft().result()
    finally:  # After an error, or if the caller stops early: leave no work in the shared pool.
        for future in underway:
            future.cancel()
        wait(underway)
