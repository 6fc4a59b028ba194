"""Clusters that cannot be used: one line that says why, before any log is sent."""

import math
import sys

import dask
import distributed
import pytest

from slamreplay.batch.cluster import Workers
from slamreplay.batch.versions import ClusterError, check_versions
from slamreplay.errors import UsageError
from slamreplay.version import __version__

ADDRESS = "tcp://10.0.0.7:8786"
HERE = {
    "host": {"python": ".".join(map(str, sys.version_info))},
    "packages": {"dask": dask.__version__, "distributed": distributed.__version__},
}


class Client:
    """What a client of dask tells of a scheduler with one worker."""

    def __init__(self, scheduler=HERE, worker=HERE, number=__version__, of_scheduler=__version__):
        self.told = {"client": HERE, "scheduler": scheduler, "workers": {"tcp://w": worker}}
        self.number = number
        self.of_scheduler = of_scheduler

    def submit(self, function, *arguments, pure):
        return self

    def release(self):
        pass

    def wait_for_workers(self, count, timeout):
        if self.number is TimeoutError:
            raise TimeoutError

    def get_versions(self):
        return self.told

    def run(self, function, *arguments, on_error):
        assert on_error == "return"
        return {"tcp://w": self.number}

    def run_on_scheduler(self, function, *arguments):
        if self.of_scheduler is None:
            raise ModuleNotFoundError("slamreplay")
        assert function(*arguments) == __version__  # it is one of Python's own
        return self.of_scheduler


def versions(python=None, **packages):
    host = HERE["host"] if python is None else {"python": python}
    return {"host": host, "packages": HERE["packages"] | packages}


def test_the_same_on_both_sides_is_taken():
    check_versions(Client(), ADDRESS)


def test_another_patch_of_python_is_taken():
    major, minor, *_ = sys.version_info
    check_versions(Client(worker=versions(f"{major}.{minor}.99.final.0")), ADDRESS)


@pytest.mark.parametrize(
    ("client", "line"),
    [
        (
            Client(worker=versions("3.9.1.final.0")),
            r"tcp://w runs python 3\.9\.1, this program 3\.",
        ),
        (Client(scheduler=versions(dask="2020.1.0")), r"the scheduler runs dask 2020\.1\.0, this"),
        (Client(worker=versions(distributed="1.0")), r"tcp://w runs distributed 1\.0, this"),
        (Client(number=ModuleNotFoundError("slamreplay")), "tcp://w has no slamreplay, this"),
        (Client(number="0.0.1"), r"tcp://w runs slamreplay 0\.0\.1, this program is"),
        (Client(of_scheduler=None), r"the scheduler has no slamreplay, .*hint: install slamreplay"),
        (Client(number=TimeoutError), r"the scheduler at tcp://10\.0\.0\.7:8786 has no worker"),
    ],
)
def test_others_are_refused_in_one_line(client, line):
    with pytest.raises(ClusterError, match=line):
        check_versions(client, ADDRESS)


@pytest.mark.parametrize("address", [ADDRESS, "tls://h:1", "host:8786", "tcp://[::1]:8786"])
def test_addresses_of_schedulers_are_taken(address):
    Workers(scheduler=address).checked()


@pytest.mark.parametrize(
    ("workers", "line"),
    [
        (Workers(count=0), "0 workers do no work"),
        (Workers(log_timeout_s=0.0), "--log-timeout 0 is no time for a log"),
        (Workers(log_timeout_s=math.nan), "--log-timeout nan is no time for a log"),
        (Workers(log_timeout_s=math.inf), "--log-timeout inf is no time for a log"),
        (Workers(memory_limit="much"), "'much' is no size"),
        (Workers(memory_limit="3"), "3 is too little"),
        (Workers(count=2, scheduler=ADDRESS), "are for workers of this machine"),
        (Workers(scheduler="nonsense"), "'nonsense' is no address"),
        (Workers(scheduler="http://h:1"), "'http://h:1' is no address"),
        (Workers(scheduler="tcp://"), "'tcp://' is no address"),
        (Workers(scheduler="tcp://h:port"), "is no address"),
    ],
)
def test_workers_that_make_no_sense_are_refused(workers, line):
    with pytest.raises(UsageError, match=line):
        workers.checked()
