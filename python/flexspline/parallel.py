"""Work on parts of a log by several threads: numpy and the core let others run meanwhile."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

__all__ = ["in_order", "together"]

Part = TypeVar("Part")
Made = TypeVar("Made")
Other = TypeVar("Other")


def in_order(threads: int, work: Callable[[Part], Made], parts: Iterable[Part]) -> Iterator[Made]:
    """Yield work(part) of each part, in order; `threads` of them are made ahead of their use.

    What is yielded does not depend on the number of threads. With one, nothing is made ahead.
    """
    if threads <= 1:
        yield from map(work, parts)
        return
    with ThreadPoolExecutor(threads) as pool:
        waiting = deque[Future[Made]]()
        for part in parts:
            waiting.append(pool.submit(work, part))
            if len(waiting) > threads:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


def together(
    threads: int, first: Callable[[], Made], second: Callable[[], Other]
) -> tuple[Made, Other]:
    """Return first() and second(), done at the same time where there are two threads."""
    if threads <= 1:
        return first(), second()
    with ThreadPoolExecutor(1) as pool:
        other = pool.submit(second)
        return first(), other.result()
