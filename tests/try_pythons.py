"""Install the package for several Pythons without lock files, and run the examples of its help.

    python tests/try_pythons.py                 # each Python of pyproject.toml, then make demo
    python tests/try_pythons.py 3.12 3.13       # these
    python tests/try_pythons.py newest --quick  # the newest of this machine, small examples alone
    python tests/try_pythons.py 3.11 --lowest   # the lowest versions of libraries; needs uv

A Python that is missing is named and makes the exit status 1.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]

TIMEOUT = 1800.0
"""Longest time of one command, on a busy machine [s]."""

QUICK_COUNTS = {"-n": 10, "--num-replicates": 10, "--repeats": 1}
"""Largest values of these options in an example with --quick."""

DRIVER = """
import numpy as np


def keep_gap(observation):
    accel = 0.2 * (observation.leader.gap - 2.0 * observation.ego.speed)
    return np.stack([accel.clip(-4.0, 1.0), np.zeros(len(accel))], axis=1)
"""

FIRST = ("generate", "import", "label")
"""Commands that write the inputs of others (data/pinto, data/scene), in the order of their runs."""

SERVERS = ("view", "carla serve")
"""Commands that run until Ctrl-C. They print a line with `READY` when they are ready."""

READY = "Ctrl-C ends"

WITH_CARLA = ("carla run", "carla replay", "carla limits")
"""Commands that need the client of CARLA, which has wheels for some Pythons only."""

WITH_FINDINGS = ("validate", "law compare")
"""Commands whose exit status 1 says that a comparison found something, not that they failed."""


class TrialError(Exception):
    """A command failed."""


@dataclass(frozen=True, slots=True)
class Environment:
    """A Python environment, and the folder in which commands run."""

    version: str
    programs: Path
    folder: Path

    def run(self, *command: str, allowed: tuple[int, ...] = (0,)) -> str:
        """Standard output of a program of the environment.

        Raises:
            TrialError: The exit status is another one than those allowed.
        """
        return run([str(self.programs / command[0]), *command[1:]], self.folder, allowed=allowed)


def run(command: list[str], folder: Path, *, allowed: tuple[int, ...] = (0,)) -> str:
    """Standard output of a command; raises TrialError with the end of its output if it fails."""
    process = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=TIMEOUT, env=environment()
    )
    if process.returncode not in allowed:
        end = "\n    ".join((process.stdout + process.stderr).strip().splitlines()[-8:])
        raise TrialError(f"exit status {process.returncode}: {shlex.join(command)}\n    {end}")
    return process.stdout


def environment() -> dict[str, str]:
    """Environment variables of this process, without those of an active environment or of make."""
    left_out = {"PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV", "MAKEFLAGS", "MAKELEVEL", "MFLAGS"}
    return {name: value for name, value in os.environ.items() if name not in left_out}


def find_python(version: str) -> str | None:
    """Path of the interpreter of a version; None if it is not installed."""
    process = subprocess.run(
        [ROOT / "setup/find_python.sh", version], capture_output=True, text=True
    )
    return process.stdout.strip() or None


def tested_versions() -> list[str]:
    """The versions that pyproject.toml says are tested, such as 3.11."""
    versions = re.findall(r":: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
    return sorted(versions, key=lambda version: int(version.removeprefix("3.")))


def install(python: str, version: str, folder: Path, *, lowest: bool) -> Environment:
    """Make an environment with the package and all extras that have wheels for this Python."""
    run([python, "-m", "venv", "env"], folder)
    trial = Environment(version, folder / "env/bin", folder)
    pip = ["python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    trial.run(*pip, "--upgrade", "pip")
    if lowest:
        pins = folder / "lowest.txt"
        pyproject = str(ROOT / "pyproject.toml")
        resolve = ["uv", "pip", "compile", "--quiet", "--resolution", "lowest-direct"]
        resolve += ["--python", python, "--extra", "all", pyproject, "--output-file", str(pins)]
        run(resolve, folder)
        trial.run(*pip, "--only-binary", ":all:", "--requirement", str(pins))
    trial.run(*pip, f"{ROOT}[all]")
    return trial


def examples(trial: Environment) -> dict[str, list[str]]:
    """The example that the help of each command prints, by the words of the command."""
    names: list[str] = []
    for name in command_names(trial):
        subcommands = command_names(trial, name)
        names += [f"{name} {subcommand}" for subcommand in subcommands] or [name]
    with ThreadPoolExecutor(2) as pool:
        return dict(zip(names, pool.map(lambda name: example(trial, name), names), strict=True))


def command_names(trial: Environment, group: str = "") -> list[str]:
    """The commands that the help of the program, or of a group of commands, lists."""
    text = trial.run("overtaking", *group.split(), "--help")
    _, _, listed = text.partition("\nCommands:\n")
    return re.findall(r"^  (\S+)", listed, re.MULTILINE)


def example(trial: Environment, name: str) -> list[str]:
    """The example in the help of a command, in words."""
    text = trial.run("overtaking", *name.split(), "--help")
    _, _, line = text.partition("\n  Example:\n")
    # A backslash ends a line that goes on, as in a shell.
    words = shlex.split(" ".join(line.replace("\\\n", " ").split()))
    if words[:1] != ["overtaking"]:
        raise TrialError(f"overtaking {name} --help prints no example")
    return words


def shortened(words: list[str]) -> list[str]:
    """An example with fewer simulations."""
    # Other examples read simulations of this data set by number, so it keeps its size.
    if words[1] == "generate":
        return words
    previous = ["", *words]
    return [
        str(min(int(word), QUICK_COUNTS[option])) if option in QUICK_COUNTS else word
        for option, word in zip(previous, words, strict=False)
    ]


def has_carla(trial: Environment) -> bool:
    """Whether the client of CARLA is installed."""
    code = "from importlib.util import find_spec; print(find_spec('carla') is not None)"
    return trial.run("python", "-c", code).strip() == "True"


def make_inputs(trial: Environment):
    """Write the files that the examples expect from the user: a driver, a scene, a map."""
    (trial.folder / "my_driver.py").write_text(DRIVER)
    arguments = ["data/pinto", "--simulations", "3", "--out", "exported"]
    for file_format, suffix, name in (
        ("commonroad", "*.xml", "scene.xml"),
        ("openscenario", "*.xodr", "town.xodr"),
    ):
        trial.run("overtaking", "export", *arguments, "--format", file_format)
        exported = next((trial.folder / "exported").glob(suffix))
        shutil.copy(exported, trial.folder / name)
        shutil.rmtree(trial.folder / "exported")


def try_server(trial: Environment, words: list[str]):
    """Start a server, wait until it is ready, and stop it as Ctrl-C does."""
    command = [str(trial.programs / words[0]), *words[1:]]
    with subprocess.Popen(
        command,
        cwd=trial.folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=environment() | {"PYTHONUNBUFFERED": "1"},
    ) as server:
        assert server.stdout is not None
        lines: list[str] = []
        for line in server.stdout:
            lines.append(line)
            if READY in line:
                break
        server.send_signal(signal.SIGINT)
        lines += server.stdout.readlines()
    if READY not in "".join(lines) or server.returncode not in (0, 130):
        raise TrialError(f"exit status {server.returncode}: {shlex.join(words)}\n{''.join(lines)}")


def try_example(trial: Environment, name: str, words: list[str]):
    """Run an example and print its time.

    Raises:
        TrialError: It failed.
    """
    begin = time.perf_counter()
    if name in SERVERS:
        try_server(trial, words)
    else:
        trial.run(*words, allowed=(0, 1) if name in WITH_FINDINGS else (0,))
    print(f"{time.perf_counter() - begin:8.1f} s  {shlex.join(words)}", flush=True)


def try_examples(trial: Environment, *, is_quick: bool) -> list[str]:
    """Run the example of every command; returns a line for each failure."""
    commands = examples(trial)
    if is_quick:
        commands = {name: shortened(words) for name, words in commands.items()}
    if not has_carla(trial):
        for name in WITH_CARLA:
            print(f" not run    {shlex.join(commands.pop(name))}: no wheel of the client of CARLA")
        commands["compare"] = [word.replace(",carla", "") for word in commands["compare"]]

    problems: list[str] = []

    def attempt(name: str):
        try:
            try_example(trial, name, commands[name])
        except (TrialError, subprocess.TimeoutExpired) as error:
            problems.append(f"Python {trial.version}: {error}")
            print(f"  FAILED    {error}", flush=True)

    for name in FIRST:
        attempt(name)
        if name == "generate":
            make_inputs(trial)
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(attempt, [name for name in commands if name not in FIRST]))
    return problems


def try_demo(python: str, version: str, clone: Path) -> list[str]:
    """Run `make demo` with the lock files, in a clone; returns a line if it fails."""
    # The engine is compiled once, as it is the same for every Python.
    for name in (".venv", "data"):
        shutil.rmtree(clone / name, ignore_errors=True)
    begin = time.perf_counter()
    try:
        run(["make", "demo", f"PYTHON={python}"], clone)
    except (TrialError, subprocess.TimeoutExpired) as error:
        return [f"Python {version}: {error}"]
    print(f"{time.perf_counter() - begin:8.1f} s  make demo PYTHON={python}", flush=True)
    return []


def try_python(version: str, clone: Path | None, options: argparse.Namespace) -> list[str]:
    """Try one Python; returns a line for each problem."""
    python = find_python(version)
    if python is None:
        return [f"Python {version}: not installed on this machine, so nothing was tried"]
    print(f"Python {version}: {python}", flush=True)
    with tempfile.TemporaryDirectory() as name:
        begin = time.perf_counter()
        try:
            trial = install(python, version, Path(name), lowest=options.lowest)
            print(f"{time.perf_counter() - begin:8.1f} s  pip install '.[all]'", flush=True)
            problems = try_examples(trial, is_quick=options.quick)
        except (TrialError, subprocess.TimeoutExpired) as error:
            problems = [f"Python {version}: {error}"]
    return problems + (try_demo(python, version, clone) if clone else [])


def main() -> int:
    """Try the Pythons that the command line names; the exit status."""
    tested = tested_versions()
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("versions", nargs="*", metavar="VERSION", help="such as 3.12, or newest")
    parser.add_argument("--quick", action="store_true", help="small examples, no make demo")
    parser.add_argument("--lowest", action="store_true", help="lowest versions of libraries")
    options = parser.parse_args()
    versions = options.versions or tested
    if versions == ["newest"]:
        installed = [version for version in tested if find_python(version)]
        if not installed:
            parser.error(f"none of Python {', '.join(tested)} is installed on this machine")
        for version in tested[tested.index(installed[-1]) + 1 :]:
            print(f"Python {version}: not installed on this machine, so not tried")
        versions = installed[-1:]

    problems: list[str] = []
    with tempfile.TemporaryDirectory() as name:
        clone = None if options.quick or options.lowest else Path(name) / "clone"
        if clone:
            run(["git", "clone", "--quiet", str(ROOT), str(clone)], ROOT)
        for version in versions:
            problems += try_python(version, clone, options)
    for problem in problems:
        print(problem, file=sys.stderr)
    print(f"Python {', '.join(versions)}: {len(problems)} problems")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
