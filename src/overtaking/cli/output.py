"""Results on stdout, remarks on stderr, a log for machines; nothing else in the package prints."""

from __future__ import annotations

import io
import json as json_format
import logging
import re
import sys
import threading
import time
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from overtaking.cli.failures import FAULT, explain
from overtaking.cli.streams import can_encode, discard, print_error_line, terminal_width
from overtaking.core.files import check_output_path

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path
    from types import TracebackType
    from typing import Self

    from rich.console import Console, RenderableType
    from rich.progress import Progress, TaskID

    from overtaking.analysis.stats.table import Table
    from overtaking.model.import_report import ImportFinding

    Part = str | Table | Mapping[str, str]
    """A paragraph, a table, or words with their meanings (a mapping)."""

_PATIENCE = 0.5  # Work that is done earlier shows no progress bar: it would only flicker [s].
_DRAWING_WIDTH = 80  # Columns of drawings made of characters, without a terminal.
_LOG_INTERVAL = 5.0  # Seconds between two lines of progress in the log.


class Output:
    """The output of one run of a command.

    Args:
        command: Name of the command.
        quiet: Whether only the result and errors are printed.
        json: Whether the result is printed as JSON.
        log: File to append the log to.
    """

    def __init__(self, command: str, *, quiet: bool, json: bool, log: Path | None) -> None:
        """Open the log, so that a wrong name is known before the work."""
        self.quiet = quiet
        self._begin = time.monotonic()
        self._json = json
        self._logger = logging.getLogger("overtaking")
        if log:
            check_output_path(log)
        self._handler = _log_handler(log) if log else None
        if self._handler:
            self._logger.addHandler(self._handler)
            self._logger.setLevel(logging.INFO)
        self.log("command started", command=command, arguments=sys.argv[1:])

    def __enter__(self) -> Self:
        """Begin the command."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Note how the command ended, and close the log."""
        if error is None:
            self.log("command done")
        else:
            line, code = explain(error)
            details = {"error": line, "exit_status": code}
            if code == FAULT:
                details["traceback"] = "".join(traceback.format_exception(error))
            self.log("command failed", level=logging.ERROR, **details)
        if self._handler:
            self._logger.removeHandler(self._handler)
            self._handler.close()

    @property
    def duration(self) -> dict[str, float]:
        """How long the command has run, for its values."""
        return {"duration_s": round(time.monotonic() - self._begin, 3)}

    def log(self, event: str, *, level: int = logging.INFO, **fields: Any) -> None:
        """Note an event with its details in the log."""
        if self._handler:
            self._logger.log(level, event, extra={"fields": fields})

    def say(self, text: str) -> None:
        """Print a remark on stderr, unless the run is quiet, and log it."""
        self.log(text)
        if not self.quiet:
            print_error_line(text)

    def say_findings(self, findings: Iterable[ImportFinding]) -> None:
        """Print an import report as remarks, one line for each check.

        Args:
            findings: The rows of the report.
        """
        from overtaking.model.import_report import summarize_findings

        for line in summarize_findings(findings):
            self.say(f"warning: {' '.join(line.split())}")

    def result(
        self, values: Mapping[str, Any], render: Callable[[Console], RenderableType]
    ) -> None:
        """Print the result of the command, also if the run is quiet.

        Args:
            values: The result for machines, with units in the names.
            render: Draws the result for people; called only if they want it.
        """
        _print(_stdout_json(values) if self._json else _drawn(render))

    def text(self, values: Mapping[str, Any], text: str) -> None:
        """Print a result that is text as it is: no line is broken, nothing is coloured.

        Args:
            values: The result for machines, with units in the names.
            text: The result for people.
        """
        _print(_stdout_json(values) if self._json else text)

    def page(self, values: Mapping[str, Any], parts: Sequence[Part]) -> None:
        """Print a result of paragraphs and tables; see `result`.

        Where lines may have any length (`terminal_width`), tables are plain text with aligned
        columns.

        Args:
            values: The result for machines, with units in the names.
            parts: The result for people, from top to bottom.
        """
        if self._json:
            self.result(values, lambda _: "")
        elif terminal_width() is None:
            _print(page_text(parts))
        else:
            self.result(values, lambda _: _drawn_parts(parts))

    def wrote(self, values: Mapping[str, Any], render: Callable[[Console], RenderableType]) -> None:
        """Sum up what the command wrote to files, unless it is to be quiet; see `result`.

        The files are complete, so a summary that cannot be printed changes no exit status.
        """
        if self._json or not self.quiet:
            try:
                self.result(values, render)
            except OSError as error:
                print_error_line(f"warning: {error.filename}: {error.strerror}; the work is done")

    def progress(self, what: str) -> Meter:
        """A progress bar for work that may be long; use it as a context."""
        return Meter(what, self)


@dataclass(frozen=True, slots=True)
class _Amount:
    """How much of some work is done.

    Attributes:
        done: Number of things that are done.
        total: Number of all things.
        text: Both as the bar writes them.
        is_steady: Whether the past speed predicts the future one, so that rate and time left are
            shown. The bytes of a table are read much faster than they are examined.
    """

    done: int
    total: int
    text: str
    is_steady: bool


class Meter:
    """A progress bar with rate and time left; it appears only where a person watches.

    The bar appears `_PATIENCE` seconds after the begin with the last report, also if no further
    report comes for a long time.

    Args:
        what: The things that are counted, such as "simulations".
        output: Where the bar and the log go.
    """

    def __init__(self, what: str, output: Output) -> None:
        """Start the clock."""
        self._what = what
        self._output = output
        self._begin = self._logged = time.monotonic()
        self._bar: Progress | None = None
        self._tasks: dict[str, TaskID] = {}
        self._reports: dict[str, _Amount] = {}  # The last one of each kind of work.
        self._timer: threading.Timer | None = None
        self._is_closed = False
        # The timer, the threads that read a file and the caller all draw.
        self._lock = threading.Lock()

    def __enter__(self) -> Self:
        """Begin the work."""
        return self

    def __exit__(self, *_: object) -> None:
        """Take the bar away."""
        with self._lock:
            self._is_closed = True
            if self._timer:
                self._timer.cancel()
            if self._bar:
                self._bar.stop()

    def __call__(self, done: int, total: int) -> None:
        """Show how much of the work is done."""
        self._show(self._what, _Amount(done, total, f"{done}/{total}", is_steady=True))

    def show_read_bytes(self, done: int, total: int) -> None:
        """Show how much of a recording is read and examined [bytes], on a line of its own."""
        share = f"{done / max(total, 1):.0%}"
        self._show("recording read", _Amount(done, total, share, is_steady=False))

    def _show(self, what: str, amount: _Amount) -> None:
        now = time.monotonic()
        if now - self._logged >= _LOG_INTERVAL:
            self._logged = now
            self._output.log("progress", what=what, done=amount.done, total=amount.total)
        if self._output.quiet or not sys.stderr.isatty():
            return
        with self._lock:
            self._reports[what] = amount
            time_left = self._begin + _PATIENCE - now
            if time_left <= 0.0:
                self._draw()
            elif self._timer is None:
                self._timer = threading.Timer(time_left, self._draw_late)
                self._timer.daemon = True
                self._timer.start()

    def _draw_late(self) -> None:
        """Draw the bar when the patience ends, unless the work is done."""
        with self._lock:
            self._draw()

    def _draw(self) -> None:
        """Draw the last report of each kind of work; the caller holds the lock."""
        if self._is_closed:
            return
        if self._bar is None:
            self._bar = _bar()
        for what, amount in self._reports.items():
            if what not in self._tasks:
                self._tasks[what] = self._bar.add_task(
                    what, amount=amount.text, is_steady=amount.is_steady
                )
            self._bar.update(
                self._tasks[what], completed=amount.done, total=amount.total, amount=amount.text
            )


def _bar() -> Progress:
    """A running progress bar on stderr, as yet without a line."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Rate(ProgressColumn):
        """Things done in a second; empty for work whose speed changes."""

        def render(self, task: Task) -> Text:
            """The mean speed of the last seconds."""
            has_rate = task.speed and task.fields["is_steady"]
            return Text(f"{task.speed:,.0f}/s" if has_rate else "")

    class TimeLeft(TimeRemainingColumn):
        """Time until the work is done; empty for work whose speed changes."""

        def render(self, task: Task) -> Text:
            """The time that is left at the mean speed of the last seconds."""
            return super().render(task) + " left" if task.fields["is_steady"] else Text("")

    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[amount]}"),
        Rate(),
        TimeLeft(),
        console=Console(stderr=True),
        transient=True,
    )
    bar.start()
    return bar


def _print(text: str) -> None:
    """Print on standard output.

    Raises:
        OSError: The text cannot be written, for example because the disk is full. A closed pipe
            is no error: its reader, such as `head`, has read enough.
    """
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except OSError as error:
        discard(sys.stdout)
        if not isinstance(error, BrokenPipeError):
            raise OSError(error.errno, error.strerror, "standard output") from error


def _stdout_json(values: Mapping[str, Any]) -> str:
    """Values as JSON; with ASCII escapes if standard output cannot encode all characters."""
    text = json_of(values)
    return text if can_encode(text, sys.stdout) else json_of(values, is_ascii=True)


def json_of(values: Mapping[str, Any], *, is_ascii: bool = False) -> str:
    """Values as JSON.

    Args:
        values: The values.
        is_ascii: Whether characters outside ASCII become escapes.
    """
    return json_format.dumps(values, indent=2, ensure_ascii=is_ascii, allow_nan=False) + "\n"


def _drawn(render: Callable[[Console], RenderableType]) -> str:
    """A drawing as text, with the escape codes that standard output understands.

    Lines fit the width that `terminal_width` returns. If it returns None, each row of a table is a
    line: no line is broken, shortened or padded, and tables have no rules, so that `grep`, `cut`
    and `wc` work.
    """
    from rich.console import Console

    from overtaking.cli.tables import UNBOUNDED, with_whole_words

    width, is_terminal = terminal_width(), sys.stdout.isatty()
    text = _EncodedText(sys.stdout.encoding or "utf-8")

    def console_of(columns: int | None) -> Console:
        return Console(file=text, force_terminal=is_terminal, highlight=False, width=columns)

    drawing = render(console_of(width or _DRAWING_WIDTH))
    if width is None:
        _unwrap(drawing)
    console_of(width or UNBOUNDED).print(with_whole_words(drawing), crop=False)
    drawn = text.getvalue()
    return drawn if is_terminal else re.sub(r"[ \t]+$", "", drawn, flags=re.MULTILINE)


def page_text(parts: Sequence[Part]) -> str:
    """The parts of a page as text of any width."""
    return "\n\n".join(map(_part_text, parts)) + "\n"


def _part_text(part: Part) -> str:
    """A part of a page as text of any width."""
    if isinstance(part, str):
        return part
    if isinstance(part, Mapping):
        width = max(map(len, part))
        return "\n".join(f"{name:<{width}}  {meaning}" for name, meaning in part.items())
    from overtaking.analysis.stats.formats import table_to_text

    return table_to_text(part)


def _drawn_parts(parts: Sequence[Part]) -> RenderableType:
    """The parts of a page, laid out for a terminal."""
    from rich.console import Group
    from rich.text import Text

    from overtaking.cli.tables import facts, result_table

    drawings: list[RenderableType] = []
    for part in parts:
        drawings += [Text()] if drawings else []
        if isinstance(part, str):
            drawings.append(Text(part))
        elif isinstance(part, Mapping):
            drawings.append(facts(part.items()))
        else:
            drawings += result_table(part)
    return Group(*drawings)


class _EncodedText(io.StringIO):
    """Text in memory with the encoding of a stream.

    Rich chooses between Unicode and ASCII characters by the encoding of its file.
    """

    def __init__(self, encoding: str) -> None:
        super().__init__(newline="")
        self._encoding = encoding

    @property
    def encoding(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The encoding of the stream."""
        return self._encoding


def _unwrap(drawing: RenderableType) -> None:
    """Let every row of the tables in a drawing be one line."""
    from rich.console import Group
    from rich.table import Table

    if isinstance(drawing, Group):
        for part in drawing.renderables:
            _unwrap(part)
    elif isinstance(drawing, Table):
        drawing.box = drawing.width = None
        drawing.pad_edge = False
        for column in drawing.columns:
            column.no_wrap = True
            column.max_width = column.ratio = None


class _JsonLines(logging.Formatter):
    """One JSON object per event."""

    def format(self, record: logging.LogRecord) -> str:
        """The event as one line."""
        line = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "event": record.getMessage(),
            **getattr(record, "fields", {}),
        }
        return json_format.dumps(line, ensure_ascii=False, default=str)


def _log_handler(path: Path) -> logging.Handler:
    """The handler that appends to the log file."""
    # File names that are not UTF-8 hold surrogates; backslashes make them escapes of JSON.
    handler = logging.FileHandler(path, encoding="utf-8", errors="backslashreplace")
    handler.setFormatter(_JsonLines())
    return handler
