"""Progress of work that has several parts."""

from overtaking.core.progress import ProgressCounter


def test_steps_of_several_parts_add_up() -> None:
    told: list[tuple[int, int]] = []
    step = ProgressCounter(5, lambda done, total: told.append((done, total)))
    step()
    step(3)
    assert told == [(1, 5), (4, 5)]
    ProgressCounter(1, None)()
