"""Many rules ask about the same case, and the answer is worked out once."""

from __future__ import annotations

import gc
import weakref

from tests.support.cases import Track, case

from overtaking.model.batch import cached_per_batch


def test_an_answer_is_worked_out_once_for_each_case():
    asked = []
    answer = cached_per_batch(lambda given: asked.append(given) or len(asked))
    one, other = (case(Track(), Track(s=50.0)) for _ in range(2))
    assert [answer(one), answer(one), answer(other), answer(one)] == [1, 1, 2, 1]


def test_an_answer_is_forgotten_with_its_case():
    class Answer:
        pass

    answer, one = cached_per_batch(lambda _: Answer()), case(Track(), Track(s=50.0))
    known = weakref.ref(answer(one))
    assert known() is not None
    del one
    gc.collect()
    assert known() is None
