"""Whether a cluster that exists runs what this program runs."""

from __future__ import annotations

import pkgutil
import platform
from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from slamreplay.errors import SlamreplayError
from slamreplay.version import __version__

if TYPE_CHECKING:
    from distributed import Client

#: How long a worker is waited for, s: a cluster may have to start a machine for it.
_FIRST_WORKER_S = 300.0
_NUMBER = "slamreplay.version:__version__"


class ClusterError(SlamreplayError):
    """A cluster that cannot be reached, lacks the program, or went away."""


def check_versions(client: Client, address: str) -> None:
    """Refuse a cluster that runs other versions: pickles and results depend on them.

    Raises:
        ClusterError: no worker came, or a version differs.
    """
    # Clusters that grow with their tasks have no worker before there is one.
    probe = client.submit(pkgutil.resolve_name, _NUMBER, pure=False)
    try:
        client.wait_for_workers(1, timeout=_FIRST_WORKER_S)
    except TimeoutError as error:
        raise ClusterError(
            f"the scheduler at {address} has no worker after {_FIRST_WORKER_S:g} s",
            hint=f"start some with `dask worker {address} --nthreads 1`",
        ) from error
    probe.release()
    told = client.get_versions()
    ours = {"python": platform.python_version(), **_packages(told["client"])}
    others = {"the scheduler": told["scheduler"], **told["workers"]}
    for name, versions in others.items():
        if versions is None:
            continue
        theirs = {
            "python": str(versions["host"]["python"]).split(".final")[0],
            **_packages(versions),
        }
        for package, version in ours.items():
            if _differs(package, theirs.get(package), version):
                raise ClusterError(
                    f"{name} runs {package} {theirs.get(package)}, this program {version}",
                    hint="the same image or environment on both sides",
                )
    for name, number in _numbers(client).items():
        if number != __version__:
            said = "has no slamreplay" if number is None else f"runs slamreplay {number}"
            raise ClusterError(
                f"{name} {said}, this program is {__version__}",
                hint=f"install slamreplay {__version__} where the workers run",
            )


def _packages(versions: Mapping[str, Any]) -> dict[str, str]:
    return {name: str(versions["packages"].get(name)) for name in ("dask", "distributed")}


def _differs(package: str, theirs: str | None, ours: str) -> bool:
    if package == "python":  # pickles hold from one patch to the next
        return str(theirs).split(".")[:2] != ours.split(".")[:2]
    return theirs != ours


def _numbers(client: Client) -> dict[str, str | None]:
    """Version of slamreplay by worker and of the scheduler, None where there is none."""
    # A function of Python's own, for one of ours could not even be sent to who lacks us.
    told = client.run(pkgutil.resolve_name, _NUMBER, on_error="return")
    with suppress(ModuleNotFoundError):
        told["the scheduler"] = client.run_on_scheduler(pkgutil.resolve_name, _NUMBER)
    told.setdefault("the scheduler", None)
    return {name: v if isinstance(v, str) else None for name, v in told.items()}
