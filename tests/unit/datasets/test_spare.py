"""Memory is used again, and no table lies in it."""

from __future__ import annotations

import numpy as np
import pytest

from overtaking.datasets.contents import contents
from overtaking.datasets.spare import Spare
from overtaking.exchange.roads import load_road
from overtaking.scenarios import sample, spec
from overtaking.sim import engine
from overtaking.tables.digest import content_of
from overtaking.tables.schemas import SCHEMAS


def test_buffers_that_came_back_are_lent_again():
    spare = Spare()
    with spare.lent() as first, spare.lent() as second:
        assert first is not second
    with spare.lent() as again:
        assert again in (first, second)


def test_buffers_of_a_piece_that_failed_are_not_lent_again():
    spare = Spare()
    with pytest.raises(ZeroDivisionError), spare.lent() as first:
        raise ZeroDivisionError
    with spare.lent() as second:
        assert second is not first


def test_tables_stay_as_they_are_when_their_buffers_are_used_again():
    given, buffers = spec("pinto2023"), engine.Buffers()

    def made(first: int, again: engine.Buffers | None):
        index = np.arange(first, first + 48, dtype=np.uint64)
        scenario = sample(given, load_road(given.road), 3, index)
        run = engine.simulate(scenario, buffers=again)
        return contents(run, index.astype(np.int64), tuple(SCHEMAS), buffers=again)

    def hashes(tables):
        return {name: content_of(table) for name, table in tables.items()}

    first, expected = made(0, buffers), hashes(made(0, None))
    second = hashes(made(48, buffers))
    assert hashes(first) == expected
    assert second == hashes(made(48, None))
