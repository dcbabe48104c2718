"""Work done ahead on several threads, and handed over in order."""

import os
from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import cache
from typing import TypeVar

from overtaking.core.process_limits import refusal_of

A = TypeVar("A")
B = TypeVar("B")


def pool_of(name: str, threads: int) -> ThreadPoolExecutor:
    """The threads of a name, the same ones as long as the process lives.

    Allocators keep memory for each thread that they have met: with new threads for every shard it
    would grow with the number of shards.
    """
    return _process_pool(os.getpid(), name, threads)


@cache
def _process_pool(process: int, name: str, threads: int) -> ThreadPoolExecutor:
    """The threads of a name in one process: a forked child has none of its parent's threads."""
    del process  # Only part of the key of the cache.
    return ThreadPoolExecutor(max_workers=threads, thread_name_prefix=f"overtaking-{name}")


def submit(pool: ThreadPoolExecutor, work: Callable[[A], B], item: A) -> Future[B]:
    """Submit work to a pool of `pool_of`.

    Raises:
        SystemLimitError: The system starts no more threads. The pool has then carried out or
            dropped all its work, and the next call of `pool_of` returns a new one.
    """
    try:
        return pool.submit(work, item)
    except RuntimeError as error:
        if (refusal := refusal_of(error, "overtaking")) is None:
            raise
        _process_pool.cache_clear()
        pool.shutdown()  # The pool has kept the work whose thread did not start.
        raise refusal from error


def in_order(work: Callable[[A], B], items: Iterable[A], threads: int) -> Generator[B]:
    """`work` of each item, in order, with as many under way as there are threads.

    NumPy and the engine leave the interpreter to others while they compute, so threads are enough;
    and no more results wait than there are threads, so memory stays flat.

    Args:
        work: The work of one piece; it must not depend on earlier pieces.
        items: With what.
        threads: How many at a time; 1 works without a thread of its own.
    """
    if threads == 1:
        yield from map(work, items)
        return
    pool = pool_of("work", threads)
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
