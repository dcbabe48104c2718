"""The reference of the command line: every command with its example, and every option once."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import typer.main
from generators.markdown import page, section, table

from overtaking.cli.app import build

if TYPE_CHECKING:
    from collections.abc import Iterator

INTRODUCTION = """\
`--help` behind a command prints its arguments and options, with defaults and an
example. Results go to standard output, remarks and errors to standard error. In a terminal, tables
fit its width; in a pipe or a file, each record is one line. The exit status is 0 for success, 1 if
`validate` or `doctor` found something, 2 for wrong input, 70 for a fault of the program and 130
after an interrupt.
"""
OPTIONS = """\
An option means the same in every command that has it.
"""


def commands() -> Iterator[tuple[str, Any]]:
    """Every command by the words that call it."""
    root: Any = typer.main.get_command(build())
    for name, command in root.commands.items():
        inner = getattr(command, "commands", {})
        yield from [(f"{name} {one}", inner[one]) for one in inner] or [(name, command)]


def example(command: Any) -> str:
    """The command line that its help shows."""
    return " ".join(command.epilog.partition("Example:")[2].split())


def options(command: Any) -> dict[str, str]:
    """The options that its help shows, with their meaning."""
    visible = [one for one in command.params if one.param_type_name == "option" and not one.hidden]
    return {", ".join(sorted(one.opts + one.secondary_opts)): one.help for one in visible}


def meaning(text: str) -> str:
    """What an option means, without what a command adds to it."""
    return re.split(r"(?<=[^.][^.\d])\.(?:\s|$)|  \[", text, maxsplit=1)[0]


def content() -> str:
    """The page `reference/commands.md`."""
    every = dict(commands())
    rows = [
        (f"`overtaking {name}`", one.help.partition("\n")[0], f"`{example(one)}`")
        for name, one in every.items()
    ]
    users: dict[tuple[str, str], list[str]] = {}
    for name, one in every.items():
        for option, text in options(one).items():
            users.setdefault((option, meaning(text)), []).append(name)
    listed = [
        (f"`{option}`", text, "all" if len(of) == len(every) else ", ".join(of))
        for (option, text), of in sorted(users.items(), key=lambda item: item[0][0].lstrip("-"))
        if not option.endswith("--help")
    ]
    return page(
        "Commands",
        INTRODUCTION,
        section("What there is", table(("command", "does", "example"), rows)),
        section("Options", OPTIONS, table(("option", "meaning", "commands"), listed)),
    )
