"""Every error of the package, in one tree, with one shape of message.

Each class is also a built-in kind, so that a caller without knowledge of this package can still
catch a `ValueError` or an `ImportError`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from overtaking.core.words import as_utf8

if TYPE_CHECKING:
    from collections.abc import Iterable
    from typing import Self

MAX_SHOWN_CHARACTERS = 160


def _one_line(part: object) -> str:
    """A part of a message on one line, without what a terminal would obey, and not too long."""
    text = as_utf8(part) if isinstance(part, str) else repr(part)
    text = " ".join(text.split())
    text = text[: MAX_SHOWN_CHARACTERS + 1]
    text = "".join(one if one.isprintable() else "�" for one in text)
    if len(text) <= MAX_SHOWN_CHARACTERS:
        return text
    return text[: MAX_SHOWN_CHARACTERS - 3] + "..."


class OvertakingError(Exception):
    """Anything that this package refuses to do; the root of the tree."""

    @classmethod
    def of(
        cls, *, what: object, where: object, expected: object, got: object, next_step: object
    ) -> Self:
        """An error whose message has everything that a reader needs to go on.

        Args:
            what: The thing that is wrong, such as a column, a key or an option.
            where: The file, section or call in which it was found.
            expected: What would have been right.
            got: The value found.
            next_step: What the reader can do now, as an imperative.

        Returns:
            The error, with the one-line message `where: what: expected ..., got ...; next_step`.
        """
        head = f"{_one_line(where)}: {_one_line(what)}"
        body = f"expected {_one_line(expected)}, got {_one_line(got)}"
        return cls(f"{head}: {body}; {_one_line(next_step)}")

    @classmethod
    def not_among(cls, what: str, where: str, known: Iterable[str], got: object) -> Self:
        """An error for a name that is none of those that are known.

        Args:
            what: What is named, such as `policy`.
            where: The call or option that was given the name.
            known: The names to choose from.
            got: The name that was given.
        """
        step = "choose one of them"
        return cls.of(what=what, where=where, expected=" or ".join(known), got=got, next_step=step)

    @classmethod
    def out_of_range(
        cls, what: str, where: str, low: object, high: object, got: object, next_step: str = ""
    ) -> Self:
        """An error for a number that is not in a range.

        Args:
            what: What the number is of.
            where: The call or option that was given the number.
            low: Smallest number.
            high: Largest number; None if there is none.
            got: The number that was given.
            next_step: What the reader can do; to choose a number in that range if left out.
        """
        expected = f"{low} or more" if high is None else f"{low} to {high}"
        step = next_step or "choose a number in that range"
        return cls.of(what=what, where=where, expected=expected, got=got, next_step=step)


class ConfigError(OvertakingError, ValueError):
    """A profile, specification, option or argument that cannot be used."""


class NoSuchSimulationError(ConfigError, IndexError):
    """The number of a simulation that a data set does not have; ends a loop over its numbers."""


class SchemaError(OvertakingError, ValueError):
    """A table or array whose columns, types, units or version are not those agreed on."""

    @classmethod
    def newer(cls, what: str, where: str, known: int, got: int) -> Self:
        """The error for a version that is newer than this package knows.

        Args:
            what: The version of what.
            where: The file.
            known: The newest that is known.
            got: The value found.
        """
        step = "use the version of overtaking that wrote it, or a newer one"
        return cls.of(what=what, where=where, expected=f"at most {known}", got=got, next_step=step)


class PolicyError(OvertakingError, RuntimeError):
    """A policy that raises, or answers what is no action."""


class ImportFormatError(OvertakingError, ValueError):
    """A file of another program that does not say what its format requires."""


class RecordingWarning(UserWarning):
    """A recording that was read, and in whose examination something was found.

    `import_report` has each finding, and what the reader did about it.
    """


class DatasetError(OvertakingError, RuntimeError):
    """A data set folder that is incomplete, damaged or in the wrong state."""


class LockedError(DatasetError):
    """A data set folder that another process is writing."""


class SystemLimitError(OvertakingError, RuntimeError):
    """Memory, threads, processes or open files that the operating system does not grant."""


class MissingExtraError(OvertakingError, ImportError):
    """An optional dependency that a command needs and that is not installed."""

    @classmethod
    def lacking(
        cls, extra: str, *, what: str, where: str, got: str = "none", otherwise: str = ""
    ) -> Self:
        """The error for an extra that is not installed; its last part is the command to run.

        Args:
            extra: Its name.
            what: The package, and what it does.
            where: What needs it.
            got: The value found.
            otherwise: What else the reader can do, as an imperative.
        """
        from overtaking.core.extras import install_command

        head = f"{where}: {what}: expected the extra [{extra}], got {_one_line(got)}"
        instead = f"; or {otherwise}" if otherwise else ""
        return cls(f"{head}; run: {install_command(extra)}{instead}")


class KnowledgeError(OvertakingError, ValueError):
    """A knowledge file with an unknown, missing, unitless or unsourced entry."""


class InfeasibleError(OvertakingError, ValueError):
    """A scenario or request that no vehicle on no road could meet."""
