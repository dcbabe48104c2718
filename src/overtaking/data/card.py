"""The data card: `README.md` for people and the Hugging Face Hub, `croissant.json` for catalogues.

Both say what the manifest says, with the texts of `card.toml`. The head of `README.md` is what the
Hub reads of a folder (https://huggingface.co/docs/hub/datasets-cards).
"""

import json
import tomllib
from dataclasses import dataclass
from functools import cache, cached_property
from importlib import resources
from typing import Any

import pyarrow as pa

from overtaking.core.units import INTEGER_UNITS
from overtaking.data.manifest import Identity, Manifest
from overtaking.data.recipe import Keep
from overtaking.data.tables.columns import flags_of, names_of, unit_of
from overtaking.data.tables.schemas import KEYS, SCHEMAS, schema_of

README_NAME = "README.md"

_DEFAULT = "features"
"""The table that the Hub shows first."""


@cache
def texts() -> dict[str, Any]:
    """The content of `card.toml`."""
    file = resources.files("overtaking.data") / "card.toml"
    return tomllib.loads(file.read_text(encoding="utf-8"))


_NOT_SHOWN = {"spec", "road", "simulations", "source", "unknown", "branches"}
"""Parts of an identity that the texts have in other words."""


@dataclass(frozen=True)
class Card:
    """The facts about a complete data set, and its card.

    Attributes:
        manifest: Its manifest.
    """

    manifest: Manifest

    @property
    def identity(self) -> Identity:
        """Its identity."""
        return self.manifest.identity

    @property
    def is_recorded(self) -> bool:
        """Whether it was imported from a recording."""
        return self.identity.source is not None

    @property
    def recording(self) -> str:
        """The name of the recording, empty for simulations."""
        return self.identity.source.recording if self.identity.source else ""

    @property
    def keywords(self) -> list[str]:
        """Keywords for catalogues."""
        kind = "trajectories" if self.is_recorded else "simulation"
        return ["overtaking", "autonomous driving", "traffic law", "driver behaviour", kind]

    @cached_property
    def schemas(self) -> dict[str, pa.Schema]:
        """The schema of each table, with nulls where the source tells nothing."""
        there = {name for shard in self.manifest.shards for name in shard.tables}
        unknown = self.identity.unknown
        return {
            name: schema_of(name, unknown, recorded=self.is_recorded)
            for name in SCHEMAS
            if name in there
        }

    def num_rows(self, table: str) -> int:
        """Number of rows of a table in all shards."""
        return sum(shard.tables[table].rows for shard in self.manifest.shards)

    @cached_property
    def facts(self) -> dict[str, Any]:
        """The values for the braces in the texts of `card.toml`."""
        identity, balance = self.identity, self.manifest.balance
        road, simulations = identity.road, self.manifest.num_simulations
        keeps_frames = identity.keep is Keep.FRAMES
        motion = texts()["motion"]["kept" if keeps_frames else "left_out"]
        files = identity.source.files if identity.source else {}
        return {
            **identity.model_dump(exclude=_NOT_SHOWN),
            "recording": plain(self.recording),
            "road": plain(road.name),
            "lanes": road.num_lanes,
            "length": road.length,
            "simulations": simulations,
            "last": simulations - 1,
            "vehicles": self.num_rows("vehicles"),
            "motion": motion.format(states=self.num_rows("states") if keeps_frames else 0),
            "files": "\n".join(
                f"| file | {plain(name)}, SHA-256 `{digest}` |" for name, digest in files.items()
            ),
            "again": self._again(),
            "branches": "\n".join(
                f"| {number} | {one.index} | {plain(one.title)} |"
                for number, one in enumerate(identity.branches)
            ),
            "content_hash": self.manifest.content_hash,
            "unknown_names": ", ".join(identity.unknown) or "nothing",
            "unknown": self._unknown(),
            "candidates": balance.candidates if balance else None,
        }

    def _again(self) -> str:
        """Further arguments of the call that makes the values again."""
        words = ["balance=made.balance"] if self.manifest.balance else []
        if (policy := self.identity.policy) is not None:
            is_sensor = isinstance(policy.observe, dict)
            observe = "made.policy.observe"
            observe = f"overtaking.Sensor(**{observe})" if is_sensor else observe
            rest = (
                "action=made.policy.action, action_repeat=made.policy.hold, name=made.policy.name"
            )
            words.append(
                f"driver=overtaking.Driver(function=function, observation={observe}, {rest})"
            )
        return "".join(f",\n        {one}" for one in words) + ("," if words else "")

    def _unknown(self) -> str:
        """The quantities that are unknown, as a part of a sentence."""
        names = ", ".join(name.replace("_", " ") for name in self.identity.unknown)
        if not names:
            return ""
        simulator = f", except what the simulator `{self.identity.simulator}` does not tell"
        return f"{'' if self.is_recorded else simulator}: {names}"

    @cached_property
    def answers(self) -> dict[str, str]:
        """The answer to each question of the datasheet, by its key, in Markdown."""
        kinds = ["recorded"] if self.is_recorded else ["simulated"]
        kinds = ["branched", *kinds] if self.identity.branches else kinds
        kinds = [*(["balanced"] if self.manifest.balance else []), *kinds, "answer"]
        return {
            one["key"]: next(one[kind] for kind in kinds if kind in one).format(**self.facts)
            for chapter in texts()["chapters"]
            for one in chapter["questions"]
        }

    def readme(self) -> str:
        """The text of `README.md`."""
        parts = texts()["readme"]
        largest = "states" if "states" in self.schemas else "vehicles"
        return "".join(
            [
                self.header(),
                parts[self._kind].format(**self.facts),
                self._balanced() if self.manifest.balance else "",
                parts["reading"].format(largest=largest),
                self.datasheet(),
                *(self._table(*one) for one in self.schemas.items()),
            ]
        )

    @property
    def _kind(self) -> str:
        """The beginning of `README.md` that it has."""
        if self.identity.branches:
            return "branched"
        return "recorded" if self.is_recorded else "simulated"

    def header(self) -> str:
        """The YAML at the beginning, in which every table that has rows is a configuration.

        The library of the Hub cannot read a table without rows.
        """
        title = f"Overtaking scenes: {plain(self.recording or self.identity.profile)}"
        return texts()["readme"]["header"].format(
            title=json.dumps(title, ensure_ascii=False),  # A JSON string is one of YAML, too.
            tags="\n".join(f"- {word}" for word in self.keywords),
            size=size_category(self.manifest.num_simulations),
            configs="\n".join(_config(name) for name in self.schemas if self.num_rows(name)),
        )

    def datasheet(self) -> str:
        """The chapter with the questions of a datasheet and their answers."""
        chapters = "\n".join(
            f"### {chapter['title']}\n\n"
            + "".join(
                f"- **{one['asked']}.** {self.answers[one['key']]}\n"
                for one in chapter["questions"]
            )
            for chapter in texts()["chapters"]
        )
        return (
            "## Datasheet\n\nThe questions are those of T. Gebru et al., *Datasheets for Datasets*,"
            f" 2021, in short.\n\n{chapters}"
        )

    def _balanced(self) -> str:
        """The chapter about the cells of a balanced data set."""
        balance = self.manifest.balance
        assert balance is not None
        cells = "\n".join(
            f"| {name} | {cell.quota} | {cell.seen} | {cell.kept} | {cell.weight:.6g} |"
            for name, cell in balance.cells.items()
        )
        counts = balance.model_dump(exclude={"cells"})
        wanted = self.identity.balance
        return texts()["readme"]["balanced"].format(**counts, cells=cells, balance=wanted)

    def _table(self, name: str, schema: pa.Schema) -> str:
        """The chapter of one table."""
        keys = ", ".join(f"`{key}`" for key in KEYS[name])
        head = texts()["readme"]["table"].format(name=name, rows=self.num_rows(name), keys=keys)
        rows = (
            f"| `{one.name}` | {'name' if names_of(one) else one.type} | {unit_text(one)} "
            f"| {meaning_of(one)} |\n"
            for one in schema
        )
        return head + "".join(rows)


def meaning_of(field: pa.Field) -> str:
    """Meaning of a column: its description, its names or bits, and whether it may be null."""
    meaning = field.metadata[b"description"].decode()
    if names := names_of(field):
        meaning = f"{meaning}: {', '.join(names)}"
    if flags := flags_of(field):
        bits = ", ".join(f"{1 << bit} {name}" for bit, name in enumerate(flags))
        meaning = f"{meaning}: {bits}"
    return f"{meaning}; may be null" if field.nullable else meaning


def unit_text(field: pa.Field) -> str:
    """The unit of a column, with the SI unit where it counts steps; empty where it has none."""
    unit = unit_of(field)
    if unit in INTEGER_UNITS:
        si, steps = INTEGER_UNITS[unit]
        return f"{unit} = 1/{steps} {si}"
    return "" if unit == "1" else unit


def plain(text: str) -> str:
    """A name from elsewhere without characters that Markdown, YAML or a terminal interpret."""
    return "".join(one if one.isprintable() and one not in "`|<>[]" else "?" for one in text)


def size_category(number: int) -> str:
    """The Hub's class of size: powers of ten from a thousand to a trillion."""
    digits = len(str(number))
    if digits < 4:
        return "n<1K"
    return "n>1T" if digits > 12 else f"{_short(digits - 1)}<n<{_short(digits)}"


def _short(power: int) -> str:
    """A power of ten with the letter of its thousands, such as 10K."""
    return f"{10 ** (power % 3)}{' KMBT'[power // 3]}"


def _config(table: str) -> str:
    """The configuration of one table for the Hub."""
    default = "  default: true\n" if table == _DEFAULT else ""
    return f'- config_name: {table}\n{default}  data_files: "{table}/*.parquet"'
