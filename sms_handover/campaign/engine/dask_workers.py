"""Workers of a Dask cluster: one that is made here on 127.0.0.1, or one whose scheduler is given by URL.

Every worker starts a process of its own for cases and watches it; what Dask does beyond handing out chunks of
tasks is to start a worker again that was killed.
"""

import json
import logging
import os
import signal
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from itertools import count, islice
from queue import Empty, SimpleQueue
from typing import Any
from uuid import uuid4

import dask
import distributed

from sms_handover.campaign.cases.case_process import CASE_PROGRAM, CaseProcess, Done
from sms_handover.campaign.cases.case_row import Beside, Row, Task, row_of
from sms_handover.campaign.definition.campaign_file import Limits
from sms_handover.campaign.definition.frozen import Frozen
from sms_handover.errors import SmsHandoverError

_HERE = "127.0.0.1"
_PREFIX = "sms_handover_cases"  # of the names that a campaign has on a scheduler
_DIGITS = 12  # [-] of the digest of a campaign in them
_CHUNK_S = 2.0  # [s] of wall time that a chunk of cases takes
_LARGEST_CHUNK = 50  # [-] cases
_WAITING = 2  # [-] chunks of each worker that are handed out
_DEATHS = 20  # [-] of workers that one chunk survives
_CLOSE_S = 1.5  # [s] that a cluster has to end by itself
_TIMEOUT = "30s"  # to reach a scheduler
_COUNT_S = 1.0  # [s] between two looks at how many workers there are
_GOES_ON = "the same command goes on"
_Answer = tuple[str, dict[str, Any], bytes]


class CasePlugin(distributed.WorkerPlugin):
    """What each worker has for the campaign: processes for cases, one for each of its threads."""

    def __init__(
        self,
        name: str,
        files: dict[str, str],
        cases: int | None,
        seed: int,
        limits: Limits,
        program: Sequence[str],
        *,
        is_here: bool,
    ) -> None:
        """Take what the processes need, and whether the worker is one that we started on this machine.

        The ``name`` is that of this driver alone, as others may have the same workers.
        """
        self.name = name
        self._files, self._cases, self._seed = files, cases, seed
        self._limits, self._program, self._is_here = limits, tuple(program), is_here

    def setup(self, worker: Any) -> None:
        """Start without a process; on this machine Ctrl-C is for the driver, which ends the workers."""
        if self._is_here:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        self._idle: SimpleQueue[CaseProcess] = SimpleQueue()
        self._has_ended = False

    def teardown(self, worker: Any) -> None:
        """End the processes; one that is in use ends after its chunk."""
        self._has_ended = True
        self._close_idle()

    def _close_idle(self) -> None:
        """End the processes that nobody uses."""
        with suppress(Empty):
            while True:
                self._idle.get_nowait().close()

    @contextmanager
    def process(self) -> Iterator[CaseProcess]:
        """Yield a process that nobody else uses."""
        try:
            process = self._idle.get_nowait()
        except Empty:
            frozen = Frozen(self._files)
            program = self._program or CASE_PROGRAM
            process = CaseProcess(frozen, self._cases, self._seed, self._limits, program)
        try:
            yield process
        finally:
            self._idle.put(process)
            if self._has_ended:
                self._close_idle()


def run_chunk(name: str, tasks: Sequence[tuple[int, str, str]]) -> list[_Answer]:
    """Carry out tasks of the driver of a name on a worker; return row, what is beside it, and trajectory."""
    worker = distributed.get_worker()
    plugin: Any = worker.plugins[name]
    with plugin.process() as process:
        done = [process.run(Task(*task)) for task in tasks]
    return [(one.row.text, asdict(one.beside), one.trajectory) for one in done]


class DaskWorkers:
    """Workers of a cluster; at most a few chunks for each of them are handed out at a time."""

    def __init__(
        self,
        frozen: Frozen,
        cases: int | None,
        *,
        workers: int = 0,
        scheduler: str = "",
        program: Sequence[str] = (),
    ) -> None:
        """Make a cluster of so many workers here, or connect to a scheduler.

        Without a ``program`` each worker takes its own Python, which need not be where that of the driver is.
        Raises SmsHandoverError if there is no scheduler.
        """
        self._cluster: Any = None
        self._threads, self._next_count = 1, 0.0
        self._name = f"{_PREFIX}-{frozen.digest[:_DIGITS]}-{uuid4().hex}"  # several drivers share a scheduler
        self._numbers = count(1)  # of chunks
        campaign = frozen.campaign(cases)
        files, seed, limits = dict(frozen.files), campaign.seed, campaign.limits
        plugin = CasePlugin(self._name, files, cases, seed, limits, program, is_here=not scheduler)
        dask.config.set({"distributed.scheduler.allowed-failures": _DEATHS})
        if not scheduler:
            self._cluster = distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                host=_HERE,
                dashboard_address=f"{_HERE}:0",  # of the state of the scheduler as text; a free port
                scheduler_kwargs={"dashboard": False},
                memory_limit=None,  # the process of cases is watched by us
                silence_logs=logging.CRITICAL,
            )
        try:
            self._client = distributed.Client(self._cluster or scheduler, timeout=_TIMEOUT)
        except OSError as error:
            self.close()
            raise SmsHandoverError(f"scheduler {scheduler} cannot be reached: {error}") from error
        try:
            self._client.register_plugin(plugin, name=self._name)
        except Exception as error:  # whatever a worker has to say, such as that the package is not there
            self.close()
            raise SmsHandoverError(f"workers cannot take cases: {_in_words(error)}") from error

    def run(self, tasks: Iterable[Task]) -> Iterator[Sequence[Done]]:
        """Yield finished chunks as they come; raises SmsHandoverError where workers or scheduler fail."""
        try:
            yield from self._chunks(tasks)
        except (OSError, distributed.CancelledError) as error:  # after as long as it takes to reach one
            raise SmsHandoverError(f"the scheduler was lost: {_in_words(error)}; {_GOES_ON}") from error

    def _chunks(self, tasks: Iterable[Task]) -> Iterator[Sequence[Done]]:
        """Hand out chunks and yield what came of each; raises what Dask raises."""
        left, self._chunk_size = iter(tasks), 1
        running = distributed.as_completed(loop=self._client.loop)
        waiting = 0

        def hand_out() -> bool:
            nonlocal waiting
            chunk = [tuple(task) for task in islice(left, self._chunk_size)]
            if not chunk:
                return False
            key = f"{self._name}-{next(self._numbers)}"
            running.add(self._client.submit(run_chunk, self._name, chunk, key=key, pure=False))
            waiting += 1
            return True

        while True:
            while waiting < _WAITING * self._count_threads() and hand_out():
                pass
            if not waiting:
                return
            future = next(running)
            waiting -= 1
            answers = answers_of(future)
            future.release()
            walls = [beside["wall"] for _, beside, _ in answers]
            mean = max(sum(walls) / len(walls), _CHUNK_S / _LARGEST_CHUNK)
            self._chunk_size = max(1, min(_LARGEST_CHUNK, round(_CHUNK_S / mean)))
            yield [_done(answer) for answer in answers]

    def close(self) -> None:
        """End the cluster, or leave the one of others as it was."""
        log = logging.getLogger("distributed")  # that the workers we end are gone is no news
        log.handlers[:], log.propagate = [logging.NullHandler()], False
        client = getattr(self, "_client", None)
        if client is not None:
            with suppress(Exception):
                if self._cluster is None:
                    client.unregister_worker_plugin(self._name)
                client.close(timeout=_CLOSE_S)
        if self._cluster is not None:
            self._kill_workers()
            with suppress(Exception):
                self._cluster.close(timeout=_CLOSE_S)

    def _kill_workers(self) -> None:
        """End the workers here at once, as asking them takes as long as what they do."""
        for nanny in self._cluster.workers.values():
            nanny.auto_restart = False
            with suppress(OSError, TypeError):  # it has none, or that has ended
                os.kill(nanny.pid, signal.SIGKILL)

    def _count_threads(self) -> int:
        """Return the number of cases that run at the same time; the scheduler is asked once a while."""
        now = time.monotonic()
        if now >= self._next_count:
            self._threads = max(sum(self._client.nthreads().values()), 1)
            self._next_count = now + _COUNT_S
        return self._threads


def answers_of(future: Any) -> list[_Answer]:
    """Return what a chunk gave; raises SmsHandoverError, whatever failed."""
    try:
        answers: list[_Answer] = future.result()
    except distributed.KilledWorker as error:
        raise SmsHandoverError(f"workers die again and again: see what kills them; {_GOES_ON}") from error
    except SmsHandoverError:
        raise
    except Exception as error:  # of the worker, of Dask or of the network
        raise SmsHandoverError(f"a worker failed: {_in_words(error)}; {_GOES_ON}") from error
    return answers


def _in_words(error: BaseException) -> str:
    """Return an error as one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())


def _done(answer: _Answer) -> Done:
    """Return a finished case as the serial workers give it."""
    text, beside, trajectory = answer
    row: Row = row_of(json.loads(text))
    return Done(row, Beside(**beside), trajectory)
