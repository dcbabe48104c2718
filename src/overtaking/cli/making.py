"""Making a data set, whoever simulates."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.cli.output import Output


def make(
    output: Output, out: Path, recipe: dict[str, Any], *, resume: bool, simulator: str = "engine"
) -> None:
    """Make a data set, or complete one, and tell about it.

    Args:
        output: Where things are said.
        out: Its folder.
        recipe: What was asked for; nothing is enough to complete what was begun.
        resume: Whether to complete what was begun.
        simulator: What simulates.
    """
    from overtaking import api
    from overtaking.cli import arguments, summary

    begin = time.monotonic()
    with output.progress("simulations") as meter:
        if resume and not recipe:
            data = api.resume(out, progress=meter)
        else:
            complete = arguments.DEFAULTS | recipe
            data = api.generate(
                out=out, resume=resume, simulator=simulator, progress=meter, **complete
            )
    values = summary.of_dataset(data, time.monotonic() - begin)
    output.result(values, lambda _: summary.render_generated(values))
