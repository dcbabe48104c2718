"""The command line: parse, call one public function, show its result."""

from __future__ import annotations

import sys


def main(arguments: list[str] | None = None) -> int:
    """Run `overtaking`.

    Args:
        arguments: The arguments of the command line; None for the arguments of the process.

    Returns:
        The exit status: 0 done, 1 done with findings, 2 wrong usage or input, 70 a fault of this
        program, 130 interrupted.
    """
    from overtaking.cli.app import build
    from overtaking.cli.failures import tell
    from overtaking.cli.streams import discard, prepare_streams

    prepare_streams()
    words = sys.argv[1:] if arguments is None else arguments
    try:
        code = build()(words or ["--help"], prog_name="overtaking", standalone_mode=False)
        sys.stdout.flush()
    except OSError as error:  # Commands handle their own errors; only help and version get here.
        discard(sys.stdout)
        if isinstance(error, BrokenPipeError):  # The reader, such as `head`, has read enough.
            return 0
        return tell(OSError(error.errno, error.strerror, "standard output"))
    except (Exception, KeyboardInterrupt) as error:
        return tell(error)
    return code if isinstance(code, int) else 0
