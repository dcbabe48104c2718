"""Work done ahead on several threads, and handed over in order."""

import os
from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import cache
from typing import TypeVar

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
            underway.append(pool.submit(work, item))
            if len(underway) > threads:
                yield underway.popleft().result()
        while underway:
            yield underway.popleft().result()
    finally:
        for future in underway:
            future.cancel()
        wait(underway)
