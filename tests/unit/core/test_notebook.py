"""Calls of functions that show their progress in notebooks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from overtaking.core.notebook import show_progress

if TYPE_CHECKING:
    from overtaking.core.progress import ProgressCallback


@show_progress
def progress_of(
    data: str, progress: ProgressCallback | None, *, interval: int = 1
) -> ProgressCallback | None:
    del data, interval
    return progress


def test_progress_may_be_positional():
    def progress(num_done: int, total: int) -> None:
        del num_done, total

    assert progress_of("data", progress, interval=2) is progress
    assert progress_of("data", progress=progress) is progress
    assert progress_of("data", None) is None
