"""Whatever goes wrong becomes one line and one exit status."""

from __future__ import annotations

import pytest
import typer

from overtaking.cli.failures import explain, tell
from overtaking.core.errors import ConfigError, DatasetError, LockedError, OvertakingError


def subclasses(kind: type) -> list[type]:
    return [kind, *(one for child in kind.__subclasses__() for one in subclasses(child))]


@pytest.mark.parametrize("kind", subclasses(OvertakingError))
def test_what_the_package_refuses_is_a_mistake_of_the_user(kind):
    line, code = explain(kind("road.toml: length: expected\n  more, got less"))
    assert code == 2
    assert line == "error: road.toml: length: expected more, got less"


def test_there_are_errors_to_test():
    assert {ConfigError, DatasetError, LockedError} < set(subclasses(OvertakingError))


def test_a_refusal_of_the_system_names_the_file(tmp_path):
    with pytest.raises(OSError, match="No such file") as caught:
        (tmp_path / "missing").open()
    line, code = explain(caught.value)
    assert line == f"error: {tmp_path / 'missing'}: No such file or directory"
    assert code == 2


def test_a_full_disk_is_told_as_such():
    line, code = explain(OSError(28, "No space left on device"))
    assert (line, code) == ("error: No space left on device", 2)


def test_too_little_memory_is_told_with_a_way_out():
    line, code = explain(MemoryError())
    assert line.startswith("error: overtaking: memory: expected a system that grants more")
    assert "ulimit -v" in line
    assert code == 2


def test_wrong_usage_says_where_help_is():
    line, code = explain(typer.BadParameter("too few"))
    assert line == "error: invalid value: too few; see overtaking --help"
    assert code == 2


def test_ctrl_c_is_told_with_the_way_on():
    line, code = explain(KeyboardInterrupt("two shards are kept;\n go on with --resume"))
    assert (line, code) == ("interrupted: two shards are kept; go on with --resume", 130)
    line, code = explain(KeyboardInterrupt())
    assert line.startswith("interrupted: nothing was left half-written")
    assert code == 130


def test_a_fault_of_the_program_shows_its_traceback_and_is_no_mistake_of_the_user(capsys):
    code = tell(ZeroDivisionError("division by zero"))
    written = capsys.readouterr()
    assert code == 70
    assert "Traceback" in written.err or "ZeroDivisionError: division by zero" in written.err
    last = written.err.strip().splitlines()[-1]
    assert last.startswith("error: a fault of overtaking itself, please report it")
    assert written.out == ""
