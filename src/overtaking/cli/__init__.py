"""The command line: parse, call one public function, show its result."""

from __future__ import annotations

import sys


def main(arguments: list[str] | None = None) -> int:
    """Run `overtaking` with the given arguments, by default those of the process.

    Returns:
        The exit status: 0 done, 1 done with findings, 2 wrong usage or input, 70 a fault of this
        program, 130 interrupted, 141 the reader of the output has closed it.
    """
    from overtaking.cli.app import build
    from overtaking.cli.failures import tell

    given = sys.argv[1:] if arguments is None else arguments
    try:
        code = build()(given or ["--help"], prog_name="overtaking", standalone_mode=False)
        sys.stdout.flush()
    except (Exception, KeyboardInterrupt) as error:
        return tell(error)
    return code if isinstance(code, int) else 0
