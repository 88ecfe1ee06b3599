"""Engines of Dask: a cluster on this machine, a scheduler that runs somewhere, workers as Slurm jobs.

Servers listen on loopback unless another address is given. Dask asks nobody who they are: whoever
reaches a scheduler can run code on it. With ``tls``, a folder with ca.pem, cert.pem and key.pem,
only those who hold a certificate of that authority can, and nobody reads along.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

from trajopt.errors import ArgumentError, MissingDependencyError
from trajopt.sweeps.child import THREAD_VARIABLES
from trajopt.sweeps.executors import Engine

LOOPBACK = "127.0.0.1"
# Starts in a row that may fail before an engine counts as broken. A Dask cluster takes seconds to
# start, and the death of any of its processes meanwhile, from outside, spoils the whole start;
# chosen: never seen in 300 random kills.
_STARTS = 12


def dask_local(workers: int, *, host: str = LOOPBACK, tls: str | Path | None = None) -> Engine:
    """Engine of a Dask cluster on this machine."""
    distributed, secure = _distributed(), _secure(tls)

    @contextmanager
    def start() -> Iterator[Executor]:
        # Memory is limited case by case; a worker that Dask ends for its memory would cost a whole
        # chunk.
        with (
            _tries_once(),
            distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                host=host,
                **secure,
                memory_limit=0,
                silence_logs=40,
                dashboard_address=None,
                # The scheduler still answers HTTP: on any free port, not on a fixed one.
                scheduler_kwargs={"dashboard_address": f"{host}:0"},
            ) as cluster,
            distributed.Client(cluster) as client,
        ):
            # Dask drops a worker that is down, even if only for a restart, some seconds after any
            # death of it.
            cluster.adapt(minimum=workers, maximum=workers, interval="1s")
            yield client.get_executor(pure=False)

    return Engine(f"Dask, {workers} local workers", start, workers, starts=_STARTS)


def dask_at(address: str, *, tls: str | Path | None = None) -> Engine:
    """Engine of a running Dask scheduler, such as "tcp://127.0.0.1:8786" ("tls://..." with
    ``tls``)."""
    distributed, secure = _distributed(), {"security": _secure(tls).get("security")}
    with distributed.Client(address, timeout="10s", **secure) as client:
        workers = max(1, sum(client.nthreads().values()))

    @contextmanager
    def start() -> Iterator[Executor]:
        with distributed.Client(address, timeout="10s", **secure) as client:
            yield client.get_executor(pure=False)

    return Engine(f"Dask at {address}", start, workers, starts=_STARTS)


def dask_slurm(
    jobs: int,
    *,
    memory: str = "2GB",
    walltime: str = "01:00:00",
    host: str = LOOPBACK,
    tls: str | Path | None = None,
    queue: str | None = None,
    directory: str | None = None,
) -> Engine:
    """Engine of Dask workers that Slurm starts, one a job, through dask-jobqueue.

    ``host`` is the address at which scheduler and workers listen; a cluster of several nodes needs
    one that the others reach. Jobs that end early are replaced.
    """
    try:
        from dask_jobqueue.slurm import SLURMCluster
    except ImportError:
        raise MissingDependencyError("dask-jobqueue", "sweep", "Dask on Slurm") from None
    distributed, secure = _distributed(), _secure(tls)
    prologue = [f"export {name}=1" for name in THREAD_VARIABLES]

    @contextmanager
    def start() -> Iterator[Executor]:
        with (
            _tries_once(),
            SLURMCluster(
                cores=1,
                processes=1,
                memory=memory,
                **secure,
                walltime=walltime,
                queue=queue,
                log_directory=directory,
                local_directory=directory,
                job_script_prologue=prologue,
                scheduler_options={
                    "host": host,
                    "dashboard": False,
                    "dashboard_address": f"{host}:0",
                },
                worker_extra_args=["--host", host, "--no-dashboard"],
            ) as cluster,
        ):
            cluster.adapt(minimum_jobs=jobs, maximum_jobs=jobs, interval="2s")
            with distributed.Client(cluster) as client:
                yield client.get_executor(pure=False)

    return Engine(f"Dask, {jobs} Slurm jobs", start, jobs, starts=_STARTS)


def _tries_once() -> AbstractContextManager[Any]:
    """Setting for schedulers made inside: a dead worker's task comes back at once, since ``Drive``
    tries again."""
    import dask

    settings: AbstractContextManager[Any] = dask.config.set(
        {"distributed.scheduler.allowed-failures": 0}
    )
    return settings


def _secure(tls: str | Path | None) -> dict[str, Any]:
    """Arguments of Dask's clusters for a folder of certificates. Raises ArgumentError."""
    if tls is None:
        return {}
    ca, cert, key = (Path(tls) / f"{name}.pem" for name in ("ca", "cert", "key"))
    if not (ca.is_file() and cert.is_file() and key.is_file()):
        raise ArgumentError("tls", str(tls), "a folder with ca.pem, cert.pem and key.pem")
    roles = ("scheduler", "worker", "client")
    files = {f"tls_{role}_cert": str(cert.resolve()) for role in roles}
    files |= {f"tls_{role}_key": str(key.resolve()) for role in roles}
    security = _distributed().Security(
        require_encryption=True, tls_ca_file=str(ca.resolve()), **files
    )
    return {"security": security, "protocol": "tls://"}


def _distributed() -> Any:
    try:
        import distributed
    except ImportError:
        raise MissingDependencyError("distributed", "sweep", "sweeps on Dask") from None
    return distributed
