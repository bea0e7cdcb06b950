"""A dask cluster that does jobs: its workers may die or join at any time, and the results are those of this machine."""

from __future__ import annotations

import asyncio
import logging
import pickle
import queue
import socket
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from typing import Any

from gsl.core.interruption import processes_starting
from gsl.core.own_code import name_failures
from gsl.errors import GslError
from gsl.rollout.place import Place
from gsl.storage.hashing import sources_hash

CONNECT = 4.0  # [s] in which a scheduler has to answer
SILENCE = 3.0  # [s] without a result after which the scheduler is asked whether it is there
EMPTY = 60.0  # [s] without any worker after which a batch is given up
LOUD = ("distributed", "tornado", "asyncio")  # loggers; what they have to say becomes one line of ours

_alone = threading.Lock()  # a worker may have several threads, but has one environment that stands by


class Cluster:
    """The workers of a scheduler, or processes of this machine that dask looks after; connected when first needed."""

    def __init__(self, address: str | None = None) -> None:
        self._address = address
        self._place = address or "the local dask cluster"
        self._client: Any = None
        self._local: Any = None
        self._levels: dict[str, int] = {}  # of other loggers, before

    def arriving(self, function: Any, frozen: bytes, jobs: Sequence[Any], workers: int) -> Iterator[tuple[int, Any]]:
        """Yield (index of job, `function(frozen, job)`) of all jobs, as they end.

        Raises:
            GslError: The scheduler is not there, or a job kills its workers.
        """
        with self._loss():
            client = self._connect(workers)
            here = Place.here(), sources_hash()
            shared = client.submit(bytes, frozen, pure=False)  # a result, which dask makes anew when its holder dies
            futures = {
                client.submit(_run, pickle.dumps((function, job)), shared, *here, pure=False): index
                for index, job in enumerate(jobs)
            }
        ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        for future in futures:
            future.add_done_callback(ended.put)
        peopled = time.monotonic()
        while futures:
            try:
                future = ended.get(timeout=SILENCE)
            except queue.Empty:
                peopled = self._look(peopled)
                continue
            result, failure = self._outcome(future)
            if failure is not None:
                raise failure
            yield futures.pop(future), result

    def close(self) -> None:
        """Let the workers go; those of this machine end."""
        for part in (self._client, self._local):
            with suppress(Exception):  # that a scheduler is gone is no news in the end
                if part is not None:
                    part.close(timeout=CONNECT)
        self._client = self._local = None
        for name, level in self._levels.items():
            logging.getLogger(name).setLevel(level)

    def _connect(self, workers: int) -> Any:
        if self._client is not None:
            return self._client
        from distributed import Client

        loud = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] in LOUD]
        self._levels = {name: logging.getLogger(name).level for name in loud} | self._levels
        for name in loud:
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        with processes_starting():
            if self._address is None:
                self._local = _start_here(workers)
            self._ask()  # a client whose scheduler is not there says so when it is too late
            self._client = Client(self._local or self._address, timeout=CONNECT, set_as_default=False)
        return self._client

    def _ask(self) -> Mapping[str, Any]:
        """Return what the scheduler says of itself."""
        from distributed import Security, rpc

        async def ask() -> Mapping[str, Any]:
            there = self._address or self._local.scheduler_address
            async with rpc(there, connection_args=Security().get_connection_args("client")) as scheduler:
                return await asyncio.wait_for(scheduler.identity(), CONNECT)

        with self._loss():
            try:
                with ThreadPoolExecutor(1) as aside:  # a notebook runs a loop of its own in this thread
                    return aside.submit(asyncio.run, ask()).result()
            except (ImportError, OSError):
                raise
            except Exception as error:  # who knows what another kind of server says
                raise OSError from error

    def _look(self, peopled: float) -> float:
        """Return when there were workers last; the batch ends where there is no scheduler, or no worker for long."""
        if self._ask()["workers"]:
            return time.monotonic()
        if time.monotonic() - peopled > EMPTY:
            raise GslError(f"{self._place}: has no worker; start one with `dask worker {self._address}`")
        return peopled

    def _outcome(self, future: Any) -> tuple[Any, Exception | None]:
        """Return what a job came to, and how it failed."""
        from distributed import KilledWorker

        with self._loss():
            failure = future.exception(timeout=CONNECT)
            if failure is None:
                return pickle.loads(future.result(timeout=CONNECT))  # noqa: S301  our own bytes, from a worker
        if isinstance(failure, KilledWorker):
            raise GslError(f"{self._place}: a job has killed several workers; look at their free memory") from failure
        problem = f"a worker cannot take a job ({type(failure).__name__}: {failure}); install the same gsl there"
        raise GslError(f"{self._place}: {problem}") from failure

    @contextmanager
    def _loss(self) -> Iterator[None]:
        """Within, a scheduler that does not answer is one line.

        Raises:
            GslError: It does not, or dask is not installed.
        """
        from concurrent.futures import CancelledError

        try:
            yield
        except ImportError as error:
            raise GslError(f"executor=dask needs dask ({error}): pip install 'gsl[dask]'") from error
        except (OSError, CancelledError) as error:
            advice = "the same command goes on once there is one, or with executor=local"
            raise GslError(f"{self._place}: no dask scheduler answers there; {advice}") from error


_chosen: ContextVar[Cluster | None] = ContextVar("chosen", default=None)


@contextmanager
def executing(cluster: Cluster | None) -> Iterator[None]:
    """Within, jobs go to a cluster; without one, to processes of this machine."""
    token = _chosen.set(cluster)
    try:
        yield
    finally:
        _chosen.reset(token)
        if cluster is not None:
            cluster.close()


def find_cluster() -> Cluster | None:
    """Return the cluster that jobs go to, if there is one."""
    return _chosen.get()


def _run(work: bytes, frozen: bytes, place: Place, sources: str) -> bytes:
    """Do one job on a worker as it would be done in a place; return what it came to and how it failed, pickled."""
    with _alone:
        try:
            if sources_hash() != sources:
                raise GslError(f"worker on {socket.gethostname()}: has another gsl; install the same on all machines")
            place.enter()
            with name_failures():
                function, job = pickle.loads(work)  # noqa: S301  our own bytes, from whoever started the command
                return pickle.dumps((function(frozen, job), None))
        except Exception as failure:
            return pickle.dumps((None, failure))


def _start_here(workers: int) -> Any:
    """Return a cluster of processes of this machine, which nobody else can reach.

    Raises:
        GslError: Its workers do not start.
    """
    from distributed import LocalCluster

    try:
        return LocalCluster(
            n_workers=workers, threads_per_worker=1, dashboard_address=None, silence_logs=logging.CRITICAL + 1,
            scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},  # else it takes port 8787, and warns if it is taken
        )  # fmt: skip
    except RuntimeError as error:
        advice = "look at free memory; a script that calls gsl does so below `if __name__ == '__main__':`"
        raise GslError(f"dask cannot start its workers here ({error}); {advice}") from error
