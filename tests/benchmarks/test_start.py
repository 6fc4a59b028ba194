"""Start-up cost. Run with: uv run pytest tests/benchmarks --benchmark-only"""

import resource
import subprocess
import sys
from pathlib import Path

PROGRAM = str(Path(sys.executable).with_name("slamreplay"))


def test_help(benchmark):
    """The goal is 0.35 s of CPU time; `extra_info` holds the CPU seconds of one run."""

    def call():
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([PROGRAM, "--help"], capture_output=True, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    benchmark.extra_info["cpu_s"] = benchmark(call)
