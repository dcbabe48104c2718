"""Errors as one line for a person and one exit status for a script."""

from __future__ import annotations

import traceback

import typer

from overtaking.cli.streams import print_error_line
from overtaking.core.errors import OvertakingError
from overtaking.core.process_limits import refusal_of

USAGE = 2
FAULT = 70  # EX_SOFTWARE of sysexits.h.
INTERRUPTED = 130  # 128 + SIGINT, as shells have it.


def tell(error: BaseException) -> int:
    """Print an error on standard error, if that is open.

    Returns:
        The exit status of the error.
    """
    line, code = explain(error)
    if code == FAULT:
        print_error_line("".join(traceback.format_exception(error)).rstrip())
    print_error_line(line)
    return code


def explain(error: BaseException) -> tuple[str, int]:
    """The line and the exit status of an error."""
    if isinstance(error, KeyboardInterrupt):
        return _interrupted(error), INTERRUPTED
    error = refusal_of(error, "overtaking") or error
    if isinstance(error, OvertakingError):
        return f"error: {_one_line(str(error))}", USAGE
    if isinstance(error, typer.TyperException):
        return f"error: {_one_line(_usage(error))}", USAGE
    if isinstance(error, OSError):
        return f"error: {_one_line(_of_the_system(error))}", USAGE
    fault = f"{type(error).__name__}: {error}"
    return f"error: a fault of overtaking itself, please report it: {_one_line(fault)}", FAULT


def _interrupted(error: KeyboardInterrupt) -> str:
    """The line after Ctrl-C; a command that can be resumed says how in the exception."""
    return f"interrupted: {_one_line(str(error)) or 'nothing was left half-written'}"


def _usage(error: typer.TyperException) -> str:
    """A message of the argument parser in the style of all other messages."""
    text = error.format_message().rstrip(".")
    text = text[:1].lower() + text[1:]
    if "Did you mean" in text or "Possible" in text:
        return text
    context = getattr(error, "ctx", None)
    command = context.command_path if context else "overtaking"
    return f"{text}; see {command} --help"


def _of_the_system(error: OSError) -> str:
    """The reason and the path of an error of the operating system."""
    reason = error.strerror or str(error)
    return f"{error.filename}: {reason}" if error.filename else reason


def _one_line(text: str) -> str:
    """Text without line breaks."""
    return " ".join(text.split())
