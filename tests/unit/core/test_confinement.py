import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.ci

pytest.importorskip("resource", reason="Windows bounds no process")

SPINS = """
from overtaking.core.process_limits import limit_process
limit_process(64, processor_s=1)
while True:
    pass
"""


def test_who_takes_more_of_a_processor_than_it_may_is_ended_by_the_signal_of_that():
    assert subprocess.run([sys.executable, "-c", SPINS], check=False).returncode == -signal.SIGXCPU
