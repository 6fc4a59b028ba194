"""A dask cluster as an operator starts it, for tests: its workers look back on logs at once."""

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

_STAND_IN = Path(__file__).with_name("batch_stand_in.py")
#: One death is enough to suspect a log, and the dead are not waited for for half a minute.
_SETTINGS = {"SCHEDULER__ALLOWED_FAILURES": "0", "COMM__TIMEOUTS__CONNECT": "2s"}


class Cluster:
    """A scheduler and workers without nannies: who is killed stays dead until it is begun anew."""

    def __init__(self, folder):
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.folder = folder
        self.scheduler = None
        self.workers = []

    def begin(self, workers=1):
        """Start what does not run, up to so many workers."""
        if self.scheduler is None or self.scheduler.poll() is not None:
            self.scheduler = self._start(
                "scheduler", "--host", "127.0.0.1", "--port", self.port, "--no-dashboard"
            )
        self.workers = [worker for worker in self.workers if worker.poll() is None]
        while len(self.workers) < workers:
            self.workers.append(
                self._start(
                    "worker", self.address, "--nthreads", 1, "--no-nanny", "--no-dashboard",
                    "--local-directory", self.folder, "--preload", _STAND_IN,
                )
            )  # fmt: skip

    def _start(self, kind, *arguments):
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *map(str, arguments)]
        settings = {f"DASK_DISTRIBUTED__{name}": value for name, value in _SETTINGS.items()}
        with (self.folder / f"{kind}.txt").open("a") as told:
            return subprocess.Popen(
                command, stdout=told, stderr=told, start_new_session=True, cwd=self.folder,
                env=os.environ | settings,
            )  # fmt: skip

    def kill(self, program):
        """As `kill -9` does."""
        if program.poll() is None:
            os.killpg(program.pid, signal.SIGKILL)
        program.wait()

    def end(self):
        for program in [*self.workers, *([self.scheduler] if self.scheduler else [])]:
            self.kill(program)
