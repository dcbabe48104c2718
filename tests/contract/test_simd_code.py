"""The engine's operations on vectors are compiled for the SIMD features of the CPU.

`with_cpu_features!` compiles its body for AVX2 or AVX-512. A closure that the compiler does not
inline there, such as one that is called twice or handed to `Option::map_or`, becomes a function
without these features. Each operation in it is then a call of a `__fearless_simd_kernel`. Results
stay the same and only time is lost, so this test reads the machine code of the built engine.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from typing import TYPE_CHECKING

import pytest

from overtaking import _core

if TYPE_CHECKING:
    from collections.abc import Iterable

KERNEL = "__fearless_simd_kernel"
OUTSIDE_THE_STEP = (
    # Once for each share, block or simulation.
    "DecisionContext<S,_>::new",
    "DriverContext<S>::empty",
    "OncomingSearch<S,_>::no_vehicles",
    "block::Block<S,_>::new",
    "recorder::Recorder<_>::finish",
    # Once for each decision of an external driver.
    "ego_action::ActionLog::action_at",
    # Once for each span of frames that labels scan, where Rayon calls a closure.
    "FnMut<A> for &F>::call_mut",
    # Once for each tick of CARLA, for a single simulation.
    "external_motion::ExternalMotion",
    "pedal_driving::resolve_contacts",
    "pedal_driving::resolve_pairs",
)
"""Parts of the names of functions that may call kernels."""

_FUNCTION = re.compile(r"^[0-9a-f]+ <(?P<name>.*)>:$")
_HASH = re.compile(r"::h[0-9a-f]{16}(?=\W|$)")


def callers_of_kernels(disassembly: Iterable[str]) -> set[str]:
    """Names of the functions that call kernels, without the hash that ends them."""
    callers = set[str]()
    caller = ""
    for line in disassembly:
        if function := _FUNCTION.match(line):
            caller = _HASH.sub("", function["name"])
        elif KERNEL in line and KERNEL not in caller:
            callers.add(caller)
    return callers


def slow_callers(disassembly: Iterable[str]) -> list[str]:
    """Callers of kernels that run in every step or decision."""
    return sorted(
        caller
        for caller in callers_of_kernels(disassembly)
        if not any(name in caller for name in OUTSIDE_THE_STEP)
    )


def test_no_step_function_calls_vector_operations_one_by_one():
    objdump = shutil.which("objdump")
    if objdump is None:
        # Where the engine is built on Linux, the linker is there and objdump with it.
        assert not os.environ.get("CI"), "objdump is missing"
        pytest.skip("objdump is missing")
    disassembly = subprocess.run(
        [objdump, "--disassemble", "--no-show-raw-insn", "--demangle", _core.__file__],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert "::vectorize" in disassembly, "the engine has no symbols"
    assert slow_callers(disassembly.splitlines()) == []


def test_a_closure_outside_is_found():
    disassembly = """
0000000000123450 <overtaking_core::collisions::stay_clear::{{closure}}::h0123456789abcdef>:
  123450:\tcall   1000 <<Avx2 as Simd>::simd_gt_f32x8::kernel::__fearless_simd_kernel::h0123>
0000000000123460 <overtaking_core::run::block::Block<S,_>::new::h0123456789abcdef>:
  123460:\tcall   1000 <<Avx2 as Simd>::splat_f32x8::kernel::__fearless_simd_kernel::h0123>
"""
    assert slow_callers(disassembly.splitlines()) == [
        "overtaking_core::collisions::stay_clear::{{closure}}"
    ]
