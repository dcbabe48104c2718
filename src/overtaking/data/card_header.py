"""The head of a data card: what the Hugging Face Hub and its library read of a folder.

Format: https://huggingface.co/docs/hub/datasets-cards. The licence is the publisher's to add.
"""

import json
from collections.abc import Iterable

from overtaking.data.croissant import keywords
from overtaking.data.datasheet import plain
from overtaking.data.manifest import Identity

_HEADER = """\
---
pretty_name: {title}
tags:
{tags}
size_categories:
- {size}
configs:
{configs}
---

"""

_SIZES = (
    *((10**3, "n<1K"), (10**4, "1K<n<10K"), (10**5, "10K<n<100K"), (10**6, "100K<n<1M")),
    *((10**7, "1M<n<10M"), (10**8, "10M<n<100M"), (10**9, "100M<n<1B"), (10**10, "1B<n<10B")),
    *((10**11, "10B<n<100B"), (10**12, "100B<n<1T")),
)
"""The Hub's classes of size, each with the number at which the next begins."""

_LARGEST = "n>1T"

_DEFAULT = "features"
"""The table that is shown to whoever names none."""


def card_header(identity: Identity, tables: Iterable[str], num_simulations: int) -> str:
    """The YAML at the beginning of a data card, in which every table is a configuration.

    Args:
        identity: What decides the content.
        tables: Names of the tables that have rows; the library cannot read one that has none.
        num_simulations: Number of simulations.
    """
    name = identity.source.recording if identity.source else identity.profile
    title = f"Overtaking scenes: {plain(name)}"
    return _HEADER.format(
        title=json.dumps(title, ensure_ascii=False),  # A JSON string is one of YAML, too.
        tags="\n".join(f"- {word}" for word in keywords(identity)),
        size=size_category(num_simulations),
        configs="\n".join(map(_config, tables)),
    )


def size_category(number: int) -> str:
    """The Hub's class of size for a number of simulations."""
    return next((name for limit, name in _SIZES if number < limit), _LARGEST)


def _config(table: str) -> str:
    """How one table is found."""
    default = "  default: true\n" if table == _DEFAULT else ""
    return f'- config_name: {table}\n{default}  data_files: "{table}/*.parquet"'
