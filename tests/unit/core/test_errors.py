"""The tree of errors and the shape of its messages."""

from __future__ import annotations

import pickle

import pytest

from overtaking.core import errors

KINDS = [
    (errors.ConfigError, ValueError),
    (errors.NoSuchSimulationError, errors.ConfigError),
    (errors.NoSuchSimulationError, IndexError),
    (errors.SchemaError, ValueError),
    (errors.DriverError, RuntimeError),
    (errors.ImportFormatError, ValueError),
    (errors.DatasetError, RuntimeError),
    (errors.LockedError, errors.DatasetError),
    (errors.SystemLimitError, RuntimeError),
    (errors.MissingExtraError, ImportError),
    (errors.KnowledgeError, ValueError),
    (errors.InfeasibleError, ValueError),
]


def example(kind: type[errors.OvertakingError], **changes: object) -> errors.OvertakingError:
    parts: dict[str, object] = {
        "what": "column v_mps",
        "where": "states.parquet",
        "expected": "float32",
        "got": "float64",
        "next_step": 'run "overtaking migrate"',
    }
    return kind(**(parts | changes))


@pytest.mark.parametrize(("kind", "builtin"), KINDS)
def test_every_error_is_ours_and_also_a_built_in_kind(
    kind: type[errors.OvertakingError], builtin: type[Exception]
):
    with pytest.raises(builtin, match="column v_mps") as caught:
        raise example(kind)
    assert type(caught.value) is kind
    assert isinstance(caught.value, errors.OvertakingError)


def test_no_error_of_the_module_is_left_out_of_the_table():
    ours = {
        item
        for item in vars(errors).values()
        if isinstance(item, type) and issubclass(item, errors.OvertakingError)
    }
    assert ours == {kind for kind, _ in KINDS} | {errors.OvertakingError}


def test_a_message_says_where_what_expected_got_and_next_step_in_this_order():
    message = str(example(errors.SchemaError))
    assert message == (
        'states.parquet: column v_mps: expected float32, got float64; run "overtaking migrate"'
    )


def test_a_message_is_one_line_whatever_its_parts_hold():
    message = str(example(errors.ConfigError, got="a\nb\r\n\tc", where="x\ny"))
    assert message.splitlines() == [message]
    assert "got a b c;" in message
    assert message.startswith("x y: ")


def test_a_terminal_obeys_nothing_in_a_message():
    message = str(example(errors.ConfigError, got="\x1b[2Ja\u202eb\x00"))
    assert message.isprintable()
    assert "got �[2Ja�b�;" in message


def test_a_value_that_is_no_text_is_shown_as_python_writes_it():
    assert "got None;" in str(example(errors.ConfigError, got=None))
    assert "expected 3.5, got ['a', 1];" in str(
        example(errors.ConfigError, expected=3.5, got=["a", 1])
    )


def test_a_huge_value_does_not_flood_the_message():
    message = str(example(errors.ConfigError, got=list(range(10_000))))
    assert len(message) < 400
    assert "..." in message


@pytest.mark.parametrize("missing", ["what", "where", "expected", "got"])
def test_a_message_needs_all_parts_but_the_next_step(missing: str):
    parts: dict[str, object] = {"what": "a", "where": "b", "expected": "c", "got": "d"}
    del parts[missing]
    with pytest.raises(TypeError, match=missing):
        errors.ConfigError(**parts)


def test_the_default_next_step_is_to_correct_the_value():
    error = errors.ConfigError(what="a", where="b", expected="c", got="d")
    assert str(error) == "b: a: expected c, got d; correct it"


@pytest.mark.parametrize("kind", [errors.OvertakingError, *dict(KINDS)])
def test_pickling_keeps_the_class_and_the_message(kind: type[errors.OvertakingError]):
    error = example(kind)
    restored = pickle.loads(pickle.dumps(error))
    assert type(restored) is kind
    assert str(restored) == str(error)
    assert restored.args == error.args


def test_a_name_that_is_unknown_comes_with_those_that_are_known():
    error = errors.ConfigError.unknown_choice(
        what="policy", where="stats", choices=("paper", "strict"), got="papr"
    )
    expected = "stats: policy: expected paper or strict, got papr; choose one of them"
    assert str(error) == expected


@pytest.mark.parametrize(
    ("high", "next_step", "expected"),
    [
        (9, "", "label: rows: expected 1 to 9, got 0; choose a number in that range"),
        (None, "ask for more", "label: rows: expected 1 or more, got 0; ask for more"),
    ],
)
def test_a_number_out_of_its_range_comes_with_the_range(high, next_step, expected):
    error = errors.ConfigError.out_of_range(
        what="rows", where="label", low=1, high=high, got=0, next_step=next_step
    )
    assert str(error) == expected
