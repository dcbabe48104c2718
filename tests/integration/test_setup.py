"""`make` finds or installs Python and Rust; stand-ins replace both."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TOOLS = ("sh", "sed", "sort", "cut", "head", "tr", "dirname", "mkdir", "chmod")

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="make and sh are of Unix")


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A clone with the scripts alone, and a folder `bin` that is all of PATH."""
    shutil.copytree(ROOT / "setup", tmp_path / "clone/setup")
    for name in ("pyproject.toml", "Cargo.toml"):
        shutil.copy(ROOT / name, tmp_path / "clone")
    (tmp_path / "bin").mkdir()
    for tool in TOOLS:
        (tmp_path / "bin" / tool).symlink_to(shutil.which(tool) or tool)
    return tmp_path / "clone"


def add_command(path: Path, script: str):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)


def add_python(path: Path, version: str, *, has_venv: bool = True):
    """A stand-in that answers the two questions that the script asks a Python."""
    minor = version.split(".")
    add_command(
        path,
        f'case "$2" in *ensurepip*) exit {int(not has_venv)};; '
        f'*) echo "{minor[0]} {minor[1]} $0";; esac',
    )


def run(clone: Path, script: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    folder = clone.parent
    return subprocess.run(
        ["/bin/sh", clone / "setup" / script, *arguments],
        env={"PATH": str(folder / "bin"), "HOME": str(folder / "home")},
        capture_output=True,
        text=True,
        timeout=60,
    )


def test_the_python_that_is_asked_for_is_used(clone: Path):
    add_python(clone.parent / "bin/python3", "3.12")
    add_python(clone.parent / "bin/python3.13", "3.13")
    process = run(clone, "find_python.sh", "python3")
    assert (process.stdout, process.stderr) == (f"{clone.parent}/bin/python3\n", "")


@pytest.mark.parametrize("version", ["3.9", "3.10", "2.7"])
def test_an_old_python_is_named_and_a_newer_one_is_used(clone: Path, version: str):
    add_python(clone.parent / "bin/python3", version)
    add_python(clone.parent / "bin/python3.12", "3.12")
    process = run(clone, "find_python.sh", "python3")
    assert process.stdout == f"{clone.parent}/bin/python3.12\n"
    assert f"python3 is Python {version}, overtaking needs 3.11 or newer" in process.stderr


def test_a_shim_that_fails_hides_no_python(clone: Path):
    """pyenv puts a shim on PATH for each version; the shims of inactive versions fail."""
    for name in ("python3", "python3.12", "python3.13"):
        add_command(
            clone.parent / "bin" / name, f"echo 'pyenv: {name}: command not found' >&2; exit 127"
        )
    installed = clone.parent / "home/.pyenv/versions/3.12.1/bin/python3.12"
    add_python(installed, "3.12")
    for version in ("python3", "python3.12", "3.12"):
        assert run(clone, "find_python.sh", version).stdout == f"{installed}\n", version


def test_a_python_without_environments_is_passed_over(clone: Path):
    add_python(clone.parent / "bin/python3", "3.11", has_venv=False)
    add_python(clone.parent / "bin/python3.14", "3.14")
    process = run(clone, "find_python.sh", "python3")
    assert process.stdout == f"{clone.parent}/bin/python3.14\n"
    assert "python3 cannot make environments (Debian: install python3-venv)" in process.stderr


def test_a_path_with_spaces_is_kept(clone: Path):
    add_python(clone.parent / "my tools/python3", "3.13")
    process = run(clone, "find_python.sh", f"{clone.parent}/my tools/python3")
    assert process.stdout == f"{clone.parent}/my tools/python3\n"


def test_a_machine_without_a_new_python_says_what_to_do(clone: Path):
    add_python(clone.parent / "bin/python3", "3.8")
    process = run(clone, "find_python.sh", "python3")
    assert (process.returncode, process.stdout) == (1, "")
    assert "python3 is Python 3.8, overtaking needs 3.11 or newer" in process.stderr
    assert "make PYTHON=/path/to/python3" in process.stderr


def test_one_version_that_is_missing_is_named(clone: Path):
    add_python(clone.parent / "bin/python3.13", "3.13")
    process = run(clone, "find_python.sh", "3.14")
    assert (process.returncode, process.stdout) == (1, "")
    assert "Python 3.14 is not installed" in process.stderr


def test_the_rust_of_the_machine_is_used(clone: Path):
    add_command(clone.parent / "bin/cargo", "echo cargo 1.95.0")
    process = run(clone, "with_rust.sh", "cargo", "build")
    assert (process.stdout, process.stderr) == ("cargo 1.95.0\n", "")
    assert not (clone / ".rust").exists()


@pytest.mark.parametrize("machine", ["missing", "old", "without a toolchain"])
def test_the_rust_of_the_clone_is_used_where_the_machine_has_none(clone: Path, machine: str):
    if machine != "missing":
        answer = "echo cargo 1.63.0" if machine == "old" else "exit 1"
        add_command(clone.parent / "bin/cargo", answer)
    add_command(clone / ".rust/cargo/bin/cargo", 'echo "cargo 1.91.0 $CARGO_HOME $RUSTUP_HOME"')
    process = run(clone, "with_rust.sh", "cargo", "build")
    assert process.stdout == f"cargo 1.91.0 {clone}/.rust/cargo {clone}/.rust/rustup\n"
    assert process.stderr == ""


def test_rust_is_installed_into_the_clone(clone: Path):
    """The stand-in for curl delivers an installer that writes a cargo."""
    add_command(
        clone.parent / "bin/curl",
        """cat <<'END'
mkdir -p "$CARGO_HOME/bin"
echo '#!/bin/sh' > "$CARGO_HOME/bin/cargo"
echo 'echo cargo 1.95.0' >> "$CARGO_HOME/bin/cargo"
chmod +x "$CARGO_HOME/bin/cargo"
echo "$@"
END""",
    )
    (clone.parent / "bin/cat").symlink_to(shutil.which("cat") or "cat")
    process = run(clone, "with_rust.sh", "cargo", "build")
    assert process.stdout == "cargo 1.95.0\n"
    assert f"cargo is not on PATH: installing Rust into {clone}/.rust" in process.stderr
    assert "--no-modify-path" in process.stderr
    assert (clone / ".rust/cargo/bin/cargo").exists()


@pytest.mark.parametrize("has_curl", [True, False])
def test_a_failed_download_says_which_command_installs_rust(clone: Path, has_curl: bool):
    if has_curl:
        add_command(clone.parent / "bin/curl", "echo 'curl: (6) no such host' >&2; exit 6")
    add_command(clone.parent / "bin/cargo", "echo cargo 1.63.0")
    process = run(clone, "with_rust.sh", "cargo", "build")
    assert (process.returncode, process.stdout) == (1, "")
    assert "needs Rust 1.89 or newer, and only cargo 1.63.0 is on PATH" in process.stderr
    assert process.stderr.splitlines()[-2].startswith("    curl ")
