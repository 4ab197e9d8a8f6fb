"""Choice of workers: serial, a cluster here, or that of a scheduler."""

from importlib import import_module
from typing import Any

from sms_handover.campaign.definition.frozen import Frozen
from sms_handover.campaign.engine.workers import SerialWorkers, Workers
from sms_handover.errors import MissingDependencyError


def workers_for(frozen: Frozen, cases: int | None, *, jobs: int, scheduler: str = "") -> Workers:
    """Return workers: those of a scheduler if given, ``jobs`` of a cluster here, or one process for 1.

    Raises MissingDependencyError where it needs the extra ``campaign``, SmsHandoverError if there is no
    scheduler.
    """
    if jobs == 1 and not scheduler:
        return SerialWorkers(frozen, cases)
    try:
        dask_workers: Any = import_module("sms_handover.campaign.engine.dask_workers")
    except ModuleNotFoundError as error:
        raise MissingDependencyError("several workers", "distributed", "campaign") from error
    workers: Workers = dask_workers.DaskWorkers(frozen, cases, workers=jobs, scheduler=scheduler)
    return workers
