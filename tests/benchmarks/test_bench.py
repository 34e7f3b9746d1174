"""The benchmark still runs, and hgorun, C and scipy still agree in it; no time is measured."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
def test_the_numbers_of_the_benchmark_agree() -> None:
    bench = Path(__file__).with_name("bench.py")  # its own process: it registers an observer
    done = subprocess.run([sys.executable, bench, "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
