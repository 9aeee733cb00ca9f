"""Parts worked on by threads: in order, few ahead, and an error comes through."""

from __future__ import annotations

import threading

import pytest

from flexspline.parallel import in_order, together


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_what_is_made_comes_in_order_for_any_number_of_threads(threads: int) -> None:
    assert list(in_order(threads, lambda part: part**2, range(20))) == [k**2 for k in range(20)]


def test_two_parts_are_made_at_the_same_time_and_no_more_are_begun_than_are_used() -> None:
    both, begun = threading.Barrier(2, timeout=10.0), list[int]()

    def work(part: int) -> int:
        begun.append(part)
        if part < 2:
            both.wait()
        return part

    made = in_order(2, work, range(100))
    assert next(made) == 0
    assert len(begun) <= 3
    assert list(made) == list(range(1, 100))


@pytest.mark.parametrize("threads", [1, 2])
def test_an_error_in_a_part_reaches_the_caller(threads: int) -> None:
    with pytest.raises(ZeroDivisionError):
        list(in_order(threads, lambda part: 1 / part, [1, 0]))
    with pytest.raises(ZeroDivisionError):
        together(threads, lambda: 1, lambda: 1 / 0)


def test_two_tasks_together_meet() -> None:
    both = threading.Barrier(2, timeout=10.0)
    assert {*together(2, both.wait, both.wait)} == {0, 1}
