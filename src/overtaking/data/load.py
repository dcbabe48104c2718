"""Reads data sets as pandas tables in SI units; simulates omitted frames again."""

from __future__ import annotations

import shlex
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from overtaking.core.errors import ConfigError, DatasetError, NoSuchSimulationError
from overtaking.core.process_limits import explain_refusals
from overtaking.core.representation import CompactRepr
from overtaking.data import plan
from overtaking.data.choice import stretches
from overtaking.data.import_report import read_report, report_frame
from overtaking.data.location import folder_of, location_of
from overtaking.data.manifest import Manifest, read_manifest
from overtaking.data.shards import ShardFiles
from overtaking.data.tables.encode_labels import contents
from overtaking.data.tables.files import read_columns, read_rows, read_table
from overtaking.data.tables.names import POLICY_NAMES, choose_reading
from overtaking.data.tables.restore import restore, restore_actions, restore_scenario
from overtaking.data.tables.schemas import RECORDED_TABLES, SCHEMAS
from overtaking.labels.law.judging import choose_policy
from overtaking.model.checks import check_arguments, check_batch

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    import pandas as pd
    from numpy.typing import NDArray

    from overtaking.data.location import Location
    from overtaking.data.plan import Shard
    from overtaking.data.recipe import Simulator
    from overtaking.data.views import Verdict
    from overtaking.model.driver_interface import Actions
    from overtaking.model.import_report import ImportFinding
    from overtaking.model.road import Road
    from overtaking.model.scenario import Scenario
    from overtaking.model.trajectories import Trajectories


def load(where: str | Path | Location, simulator: Simulator) -> Dataset:
    """A complete data set.

    Args:
        where: Its folder, or its URL in a store.
        simulator: Simulates omitted frames again.

    Raises:
        DatasetError: The folder holds no complete data set.
        SchemaError: A newer version wrote the data set, or its first shard lacks a column.
    """
    location = location_of(where)
    manifest = read_manifest(location)
    if not manifest.complete:
        raise DatasetError(
            what="data set",
            where=str(location),
            expected="one that is complete",
            got="one that is not finished",
            next_step=f"run: overtaking generate --resume --out {shlex.quote(str(location))}",
        )
    data = Dataset(location, manifest, simulator)
    data.check_first_shard()
    return data


class Dataset(CompactRepr):
    """A complete data set in a folder or a store.

    Simulations are numbered from 0. Every method that returns a table reads it anew; a file whose
    bytes are not those that were written is an error, whatever it would have said.
    """

    def __init__(self, location: Location, manifest: Manifest, simulator: Simulator) -> None:
        """Use `load`, which checks the location."""
        self._location, self._manifest, self._simulator = location, manifest, simulator
        self._files = ShardFiles(location, manifest)
        self._shards = self._files.shards

    def __len__(self) -> int:
        """Number of simulations."""
        return self._manifest.num_simulations

    @check_arguments
    def __getitem__(self, simulation: int) -> Trajectories:
        """One recorded simulation, as a batch of one; omitted frames are simulated again.

        `batches` is the quick way through all of them.

        Args:
            simulation: Its number; -1 is the last one.

        Raises:
            DatasetError: Simulated again, it has another trace hash: the simulator has changed.
            NoSuchSimulationError: There is no such number; it is an `IndexError` as well.
        """
        number = int(simulation)
        return self.trajectory(number + len(self) if -len(self) <= number < 0 else number)

    def summary(self) -> Mapping[str, object]:
        """Location, profile, size, and kept tables."""
        return {
            "where": self.where,
            "profile": self.profile,
            "simulations": len(self),
            "keep": str(self._manifest.identity.keep),
        }

    @property
    def where(self) -> str:
        """Its folder, or its URL."""
        return str(self._location)

    @property
    def name(self) -> str:
        """The name of its folder, or the last part of its URL."""
        return self._location.name

    @property
    def path(self) -> Path:
        """Its folder.

        Raises:
            ConfigError: It lies in a store.
        """
        return folder_of(self.where, "write beside the data")

    @property
    def manifest(self) -> Manifest:
        """The content of `dataset.json`."""
        return self._manifest

    @property
    def profile(self) -> str:
        """Name of the profile that it was drawn from."""
        return self._manifest.identity.profile

    @property
    def road(self) -> Road:
        """Its road."""
        return self._manifest.identity.road

    @property
    def content_hash(self) -> str:
        """Hash over the values of all tables, the same on every machine."""
        return str(self._manifest.content_hash)

    def simulations(self) -> pd.DataFrame:
        """One row per simulation."""
        return _decoded(self.table("simulations"))

    def weather(self) -> pd.DataFrame:
        """One row per weather; `simulations` names them."""
        return _decoded(self.table("weather"))

    def vehicles(self) -> pd.DataFrame:
        """One row per simulation and vehicle: bodies, drivers, starts and contacts."""
        return _decoded(self.table("vehicles"))

    def percepts(self) -> pd.DataFrame:
        """One row per simulation and decision: what the ego believed, and the truth beside it."""
        return _decoded(self.table("percepts"))

    def actions(self) -> pd.DataFrame:
        """One row per simulation and change of what another driver did with the ego.

        Raises:
            ConfigError: The model drove every ego.
        """
        return _decoded(self.table("actions"))

    def events(self) -> pd.DataFrame:
        """One row per simulation and event that happened."""
        return _decoded(self.table("events"))

    def labels(self) -> pd.DataFrame:
        """One row per simulation and policy: class, outcome, and how it came to that."""
        return _decoded(self.table("labels"))

    def findings(self) -> pd.DataFrame:
        """One row per simulation and rule: verdict, margin and the frames that prove it."""
        return _decoded(self.table("findings"))

    def attempts(self) -> pd.DataFrame:
        """One row per simulation: the state when the overtake began, or could have begun."""
        return _decoded(self.table("attempts"))

    def safety(self) -> pd.DataFrame:
        """One row per simulation and moment: surrogate measures of safety."""
        return _decoded(self.table("safety"))

    @property
    def import_report(self) -> pd.DataFrame:
        """The findings of the examination of the recording, one row each.

        Columns: `recording`, `check`, `vehicle` (text; missing for the whole file), `first_time_s`
        (as the file counts; NaN for the whole file), `rows`, `consequence` ("corrected", "left out"
        or "reported") and `detail`. Empty for simulations of this package.

        Raises:
            DatasetError: The file of the report is missing or damaged.
        """
        return report_frame(self.import_findings)

    @cached_property
    def import_findings(self) -> tuple[ImportFinding, ...]:
        """The rows of `import_report`.

        Raises:
            DatasetError: The file of the report is missing or damaged.
        """
        return read_report(self._location, self._manifest.import_report)

    @check_arguments
    def features(
        self, policy: str | None = None, *, reading: str | None = None, encoded: bool = False
    ) -> pd.DataFrame:
        """The paper's fifteen features and the class, one row per simulation.

        Args:
            policy: Which rules decide about the class: `paper`, `default` or `strict`; None for the
                default of the profile.
            reading: How features are measured, `paper` or `matched`; `paper` for the policy of that
                name, else `matched`, if left out.
            encoded: Whether names become the paper's numbers and missing values 0.

        Returns:
            Columns with the paper's names and units (km/h, m, s, %), and `weight`.

        Raises:
            ConfigError: There is no such policy or reading.
        """
        from overtaking.data.views import features_frame

        chosen_policy = choose_policy(policy, self.profile)
        tables = [_decoded(self.table(name)) for name in ("features", "labels")]
        return features_frame(
            *tables,
            policy=chosen_policy,
            reading=choose_reading(reading, chosen_policy),
            encoded=encoded,
        )

    @check_arguments
    def verdict(self, simulation: int) -> Verdict:
        """The labels of one simulation: class, phases, and every rule with its evidence."""
        from overtaking.data.views import verdict_of

        names = ("labels", "events", "findings")
        return verdict_of(simulation, *(_decoded(self.rows(name, simulation)) for name in names))

    @check_arguments
    def frames(self, simulation: int) -> pd.DataFrame:
        """The 22 variables of the source paper for one simulation, one row per frame.

        What belongs to each vehicle is a tuple with one element per vehicle. `states` has the same
        and more, one row per vehicle and frame.
        """
        rows = self._rows(simulation)
        if "frames" not in rows:
            rows = self._encoded(simulation)
        from overtaking.data.views import wide_frames

        return wide_frames({name: _decoded(table) for name, table in rows.items()})

    @check_arguments
    def states(self, simulation: int) -> pd.DataFrame:
        """The states of one simulation, one row per vehicle and frame."""
        if "states" in self._tables:
            return _decoded(self.rows("states", simulation))
        return _decoded(self._encoded(simulation)["states"])

    @check_arguments
    def scenario(self, simulation: int) -> Scenario:
        """The scenario of one simulation, as a batch of one."""
        rows = {
            name: self.rows(name, simulation) for name in ("simulations", "weather", "vehicles")
        }
        return self._scenario(rows)

    @check_arguments
    def trajectory(self, simulation: int) -> Trajectories:
        """One recorded simulation, as a batch of one; simulated again if it was not kept.

        Raises:
            DatasetError: Simulated again, it is another one: the simulator has changed since.
        """
        return self._recorded(self._rows(simulation))

    def batches(
        self, chosen: NDArray[np.int64] | None = None
    ) -> Iterator[tuple[NDArray[np.int64], Trajectories]]:
        """Simulations in order, as many at a time as memory is meant to hold.

        Args:
            chosen: Their numbers in order, each once, shape (chosen,); all by default.

        Yields:
            The numbers of some simulations, shape (simulation,), and their recordings.

        Raises:
            DatasetError: A file is damaged, or the simulator has changed.
        """
        size = plan.chunk_size(self._manifest.identity.spec)
        for shard in self._shards:
            for chunk in plan.chunks(shard, size):
                numbers = np.arange(chunk[0], chunk[-1] + 1)
                wanted = numbers if chosen is None else np.intersect1d(numbers, chosen)
                for some in stretches(wanted):
                    first, last = int(some[0]), int(some[-1])
                    with explain_refusals("Dataset.batches"):
                        recorded = self._recorded(self._rows(first, last))
                        if len(some) < last - first + 1:
                            recorded = recorded.select(some - first)
                    yield some, recorded

    @check_arguments
    def balance_weights(self, first: int, last: int) -> NDArray[np.float64]:
        """Weights that give back the natural rates, shape (simulation,).

        Args:
            first: Number of a simulation.
            last: Number of one in the same file, not before it.

        Raises:
            DatasetError: The file is damaged.
        """
        rows = self.rows("labels", first, last)
        return rows["balance_weight"].to_numpy()[:: len(POLICY_NAMES)]

    @check_arguments
    def table(self, name: str) -> pa.Table:
        """A whole table as it is in the files.

        Raises:
            DatasetError: It was not kept, or a file is damaged.
        """
        if name not in self._tables:
            raise ConfigError(
                what=f"table {name}",
                where=self.where,
                expected=f"one of {', '.join(self._tables)}",
                got=f"a data set that keeps the {self._manifest.identity.keep}",
                next_step="generate it with --keep frames",
            )
        parts = [self._shard_table(name, shard) for shard in self._shards]
        return pa.concat_tables(parts, promote_options="default")  # Shards may differ in nulls.

    def columns(self, **wanted: Sequence[str]) -> Iterator[tuple[int, Mapping[str, pa.Table]]]:
        """Some columns of some tables, a file of each at a time, in the order of simulations.

        Args:
            wanted: Names of columns, by the name of their table.

        Yields:
            The number of the first simulation in the files, and the columns by table.

        Raises:
            DatasetError: A file is missing or damaged, or there never was such a table.
        """
        for shard in self._shards:
            tables = {
                table: self._shard_table(table, shard, names) for table, names in wanted.items()
            }
            yield shard.first, tables

    @property
    def kept_tables(self) -> tuple[str, ...]:
        """Names of the tables that have files."""
        shards = self._manifest.shards
        return tuple(name for name in self._tables if all(name in one.tables for one in shards))

    @check_arguments
    def files(self, name: str, *, is_checked: bool = True) -> list[Path]:
        """The files of a table, in the order of their simulations.

        Args:
            name: Name of a table that was kept.
            is_checked: Whether the checksums of the files are tested.

        Raises:
            DatasetError: A file is damaged.
        """
        return self._files.of(name, is_checked=is_checked)

    def check_first_shard(self) -> None:
        """Check version, columns and number of rows of each table in the first shard.

        Raises:
            DatasetError: A table has more rows than its simulations can have, or others than the
                manifest states.
            SchemaError: A table lacks a column, or is of a newer version.
        """
        self._files.check_first_shard()

    def verify(self) -> None:
        """Read every file and test its checksum.

        Raises:
            DatasetError: One of them is missing or damaged.
        """
        self._files.verify()
        read_report(self._location, self._manifest.import_report)

    @property
    def _tables(self) -> tuple[str, ...]:
        return self._manifest.identity.tables

    @check_arguments
    def rows(self, table: str, first: int, last: int | None = None) -> pa.Table:
        """The rows of one simulation, or of all up to another one in the same file.

        Args:
            table: Name of a table that was kept.
            first: Number of the simulation.
            last: Number of the last simulation; `first` if left out.

        Raises:
            DatasetError: The file is damaged.
            NoSuchSimulationError: There is no such simulation.
        """
        if not 0 <= first < len(self):
            end = len(self) - 1
            raise NoSuchSimulationError.out_of_range(
                what="simulation", where=self.where, low=0, high=end, got=first
            )
        shard = self._shards[first // self._manifest.identity.shard_size]
        path = self._files.one(table, shard)
        rows = read_rows(path, table, first, first if last is None else last)
        self._files.check_simulations(rows, str(path), table, shard)
        return rows

    def _shard_table(
        self, table: str, shard: Shard, columns: Sequence[str] | None = None
    ) -> pa.Table:
        """The rows of a table in one file, with all columns or some."""
        path = self._files.one(table, shard)
        rows = read_table(path, table) if columns is None else read_columns(path, table, columns)
        self._files.check_simulations(rows, str(path), table, shard)
        return rows

    def _rows(self, first: int, last: int | None = None) -> Mapping[str, pa.Table]:
        """The same rows in every table of recordings that was kept."""
        names = [name for name in self._tables if name in RECORDED_TABLES]
        return {name: self.rows(name, first, last) for name in names}

    def _scenario(self, rows: Mapping[str, pa.Table]) -> Scenario:
        """The scenarios of some simulations, from their rows."""
        identity = self._manifest.identity
        scenario = restore_scenario(rows, self.road, identity.unknown, identity.pushes)
        check_batch(scenario, self.where)
        if identity.spec:
            self._check_times(scenario, identity.spec)
        return scenario

    def _check_times(self, scenario: Scenario, spec: Mapping[str, Any]) -> None:
        """Refuse times that the specification does not give: they decide the number of frames."""
        interval_ms, horizon_s = spec["profile"]["frame_interval_ms"], spec["time"]["horizon_s"]
        longest = float(scenario.horizon.max(initial=0.0))
        for column, is_right, expected, got in (
            (
                "frame_interval_ms",
                scenario.frame_interval_ms == interval_ms,
                interval_ms,
                scenario.frame_interval_ms,
            ),
            ("horizon_s", longest <= np.float32(horizon_s), f"at most {horizon_s:g}", longest),
        ):
            if not is_right:
                raise DatasetError(
                    what=f"column {column} of table simulations",
                    where=self.where,
                    expected=f"{expected}, as the manifest states",
                    got=got,
                    next_step="restore the data set from a copy, or generate it again",
                )

    def _recorded(self, rows: Mapping[str, pa.Table]) -> Trajectories:
        """The recordings of some simulations, from their rows or simulated again."""
        if "states" in rows:
            identity = self._manifest.identity
            restored = restore(rows, self.road, identity.unknown, identity.pushes)
            check_batch(restored, self.where)
            return restored.replace(import_findings=self.import_findings)
        again = self._again(self._scenario(rows), restore_actions(rows))
        hashes = b"".join(rows["simulations"]["trace_hash"].to_pylist())
        known = np.frombuffer(hashes, dtype="<u4").reshape(-1, 4)
        changed = np.flatnonzero((again.trace_hash != known).any(axis=1))
        if len(changed):
            number = rows["simulations"]["simulation"][int(changed[0])].as_py()
            raise DatasetError(
                what=f"simulation {number}, simulated again",
                where=self.where,
                expected="the recorded trace hash",
                got=f"another from {self._simulator.name} {self._simulator.version}",
                next_step=self._manifest.how_to_simulate,
            )
        return again

    def _again(self, scenario: Scenario, actions: Actions | None) -> Trajectories:
        """Simulate what was not kept; another driver's actions are carried out, it is not asked."""
        if actions is None:
            return self._simulator.simulate(scenario)
        if self._simulator.replay is None:
            raise DatasetError(
                what="simulator",
                where=self.where,
                expected="one that carries out recorded actions",
                got=self._simulator.name,
                next_step="load it with the engine or the reference",
            )
        return self._simulator.replay(scenario, actions)

    def _encoded(self, simulation: int) -> Mapping[str, pa.Table]:
        """Every table of one simulation that is simulated again."""
        return contents(self.trajectory(simulation), np.array([simulation]), tuple(SCHEMAS))


def _decoded(table: pa.Table) -> pd.DataFrame:
    """A table for people. Pandas is loaded here: writing a data set does not need it."""
    with explain_refusals("Dataset"):
        from overtaking.data.tables.decode import decode

        return decode(table)
