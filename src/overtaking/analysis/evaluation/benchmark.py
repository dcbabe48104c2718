"""Benchmarks: named sets of scenes and endpoints that do not change."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from overtaking.analysis.evaluation.endpoints import PRIMARY
from overtaking.analysis.evaluation.run import evaluate
from overtaking.analysis.result_methods import Reportable
from overtaking.core.equality import ContentEquality
from overtaking.core.errors import ConfigError
from overtaking.core.files import read_toml
from overtaking.core.representation import CompactRepr
from overtaking.scenarios import profiles
from overtaking.scenarios.specification_values import suggestion
from overtaking.sim import MODEL_VERSION

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from overtaking.analysis.evaluation.results import Evaluation
    from overtaking.analysis.evaluation.run import Contestant
    from overtaking.core.progress import ProgressCallback
    from overtaking.model.road import Road
    from overtaking.scenarios.specification import Specification

FOLDER: Final = Path(__file__).with_name("benchmarks")
_MOST_BYTES: Final = 1 << 20
_KEYS: Final = ("name", "version", "model_version", "endpoints", "scenes")


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenes:
    """A part of a benchmark.

    Attributes:
        profile: Name of a profile of the package.
        simulations: Number of scenes.
        seed: Seed of their random numbers.
        sha256: Hash over the profile; see `hash_of`.
    """

    profile: str
    simulations: int
    seed: int
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Benchmark:
    """A named, versioned set of scenes.

    Attributes:
        name: Its name.
        version: Its version; results of another one are not comparable.
        model_version: Version of the simulated model.
        endpoints: Names of the primary endpoints.
        parts: Its scenes.
    """

    name: str
    version: int
    model_version: str
    endpoints: tuple[str, ...]
    parts: tuple[Scenes, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchmarkResult(CompactRepr, ContentEquality, Reportable):
    """The evaluations of a benchmark.

    Attributes:
        title: Name and version of the benchmark.
        evaluations: One for each profile.
    """

    title: str
    evaluations: tuple[Evaluation, ...]

    def values(self) -> dict[str, Any]:
        """Everything for JSON."""
        return {
            "benchmark": self.title,
            "evaluations": [one.values() for one in self.evaluations],
        }


def names() -> tuple[str, ...]:
    """The benchmarks of the package."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def hash_of(spec: Specification) -> str:
    """SHA-256 over everything that a specification says."""
    return hashlib.sha256(json.dumps(spec.to_dict(), sort_keys=True).encode()).hexdigest()


def read(source: str | Path) -> Benchmark:
    """A benchmark, checked.

    Args:
        source: Its name, or a TOML file.

    Raises:
        ConfigError: There is none, something in it cannot be used, or a profile or the model is not
            the one that it was made with.
    """
    path = FOLDER / f"{source}.toml" if source in names() else Path(source)
    if path.suffix != ".toml":
        raise ConfigError.unknown_choice(
            what="benchmark", where="evaluate", choices=names(), got=str(source)
        )
    try:
        table = read_toml(path, _MOST_BYTES)
        _check_keys(path, table)
        found = Benchmark(
            name=str(table["name"]),
            version=int(table["version"]),
            model_version=str(table["model_version"]),
            endpoints=tuple(table["endpoints"]),
            parts=tuple(Scenes(**one) for one in table["scenes"]),
        )
    except ConfigError:
        raise  # It is a ValueError too, and names the key already.
    except OSError as error:
        raise ConfigError(
            what="benchmark",
            where=str(path),
            expected="a readable TOML file",
            got=error.strerror or str(error),
            next_step="correct the path",
        ) from error
    except (ValueError, RecursionError, KeyError, TypeError) as error:
        raise _refused(
            path, "a benchmark: name, version, model_version, endpoints, [[scenes]]", error
        ) from error
    _check(found, path)
    return found


def _check(found: Benchmark, path: Path) -> None:
    """Refuse a benchmark whose numbers would mean something else than when it was made."""
    fixed = tuple(one.name for one in PRIMARY)
    if found.endpoints != fixed:
        raise _refused(path, f"the endpoints {', '.join(fixed)}", ", ".join(found.endpoints))
    if found.model_version != MODEL_VERSION:
        raise _refused(path, f"model {MODEL_VERSION}, which is here", found.model_version)
    for one in found.parts:
        if (known := hash_of(profiles.load_specification(one.profile))) != one.sha256:
            expected = f"the profile {one.profile} that is here, {known[:16]}"
            raise _refused(path, expected, one.sha256[:16])


def _check_keys(path: Path, table: Iterable[str]) -> None:
    """Refuse unknown keys at the top level of a benchmark.

    Raises:
        ConfigError: A key is unknown.
    """
    for key in table:
        if key not in _KEYS:
            raise ConfigError(
                what=key,
                where=path.name,
                expected="a known key",
                got=repr(key),
                next_step=suggestion(key, _KEYS),
            )


def _refused(path: Path, expected: str, got: object) -> ConfigError:
    return ConfigError(
        what="benchmark",
        where=path.name,
        expected=expected,
        got=str(got),
        next_step="use the version of overtaking that made it, or make a new version of it",
    )


def run(
    benchmark: Benchmark,
    policy: Contestant,
    references: Sequence[Contestant],
    stay: Contestant,
    road_of: Callable[[str], Road],
    progress: ProgressCallback | None,
) -> BenchmarkResult:
    """Evaluate a policy in every part of a benchmark.

    Args:
        benchmark: Which one.
        policy: The driver that is evaluated.
        references: Drivers to compare it with.
        stay: The driver that time is gained over.
        road_of: Reads the road of a profile.
        progress: Called with the number of simulations that are done, and of all.
    """
    drivers = len({stay.name, policy.name, *(one.name for one in references)})
    total, before = drivers * sum(one.simulations for one in benchmark.parts), 0
    found: list[Evaluation] = []
    for part in benchmark.parts:
        done = before

        def add(number: int, _: int, done: int = done) -> None:
            if progress is not None:
                progress(done + number, total)

        spec = profiles.load_specification(part.profile)
        found.append(
            evaluate(
                spec,
                road_of(spec.road),
                part.simulations,
                part.seed,
                policy=policy,
                references=references,
                stay=stay,
                progress=add,
            )
        )
        before += drivers * part.simulations
    return BenchmarkResult(
        title=f"{benchmark.name}, version {benchmark.version}", evaluations=tuple(found)
    )
