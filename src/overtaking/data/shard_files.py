"""The files of a complete data set, each compared with what was written before it is read."""

from functools import partial
from pathlib import Path

from overtaking.core.errors import DatasetError
from overtaking.data import plan, write
from overtaking.data.manifest import Manifest
from overtaking.data.place import Place


class ShardFiles:
    """Gives the files of a data set to whoever reads them.

    Args:
        place: Where they lie.
        manifest: What is known of them.
    """

    def __init__(self, place: Place, manifest: Manifest) -> None:
        """Read nothing yet."""
        self._place, self._manifest = place, manifest
        self._intact: set[str] = set()
        self.shards = plan.shards(manifest.num_simulations, manifest.identity.shard_size)

    def one(self, table: str, shard: plan.Shard) -> Path:
        """A file, once its bytes have been compared with what was written.

        Raises:
            DatasetError: It is missing or damaged, or there never was such a table.
        """
        name = write.name_of(table, shard)
        path = self._fetched(table, shard)
        if name not in self._intact:
            facts = self._manifest.shards[shard.number].tables[table]
            if not write.is_intact(partial(path.open, "rb"), facts):
                raise self._damaged(name, "others")
            self._intact.add(name)
        return path

    def of(self, table: str, *, is_checked: bool = True) -> list[Path]:
        """The files of a table, in the order of their simulations.

        Args:
            table: Name of a table that was kept.
            is_checked: Whether their bytes are compared with what was written.
        """
        give = self.one if is_checked else self._fetched
        return [give(table, shard) for shard in self.shards]

    def verify(self) -> None:
        """Read every file and compare it with what was written.

        Raises:
            DatasetError: One of them is missing or damaged.
        """
        self._intact.clear()
        for shard in self.shards:
            for table in self._manifest.shards[shard.number].tables:
                self.one(table, shard)

    def _fetched(self, table: str, shard: plan.Shard) -> Path:
        if table not in self._manifest.shards[shard.number].tables:
            raise self._older(table)
        name = write.name_of(table, shard)
        try:
            return self._place.fetch(name)
        except OSError as error:
            raise self._damaged(name, error.strerror or str(error)) from None

    def _damaged(self, name: str, got: str) -> DatasetError:
        return DatasetError.of(
            what="file",
            where=self._place.at(name),
            expected="the bytes that were written",
            got=got,
            next_step=f"run: overtaking generate --resume --out {self._place}",
        )

    def _older(self, table: str) -> DatasetError:
        """What to say of a table that came into being after the data set was made."""
        return DatasetError.of(
            what=f"table {table}",
            where=str(self._place),
            expected="one of this version",
            got="a data set that was made before there was such a table",
            next_step=f"run: overtaking label {self._place}",
        )
