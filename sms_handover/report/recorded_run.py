"""Recorded run: its arrays and what its bag says about it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf
from pathlib import Path

from sms_handover.analysis.clearance import TaskTexts
from sms_handover.analysis.comparison import Comparison, compare
from sms_handover.bag.info import BagInfo, read_info
from sms_handover.bag.run.loop_record import LoopRecord, read_loop
from sms_handover.bag.run.reader import read_run
from sms_handover.clearance.contacts import CONTACT_DEPTH
from sms_handover.engines.verdict import Verdict as EngineVerdict
from sms_handover.errors import BagError, ConfigurationError
from sms_handover.graph.topics import CONTROLLER, PLANT
from sms_handover.plant.deputy import GraspTolerance
from sms_handover.run_data import RunData

UNKNOWN_LAW = "unknown"

_CONTACT_DEPTH = "contact_depth"
_TOLERANCES = ("grasp_position_tolerance", "grasp_angle_tolerance", "grasp_speed_tolerance")
_RATE_TOLERANCE = "grasp_rate_tolerance"  # older versions did not judge the rate


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """The arrays of a run under a name, the description of its bag, and what a second engine says of it."""

    name: str
    data: RunData
    info: BagInfo
    second_engine: EngineVerdict | None = None

    @cached_property
    def loop(self) -> LoopRecord:
        """Return the wall-clock record of the run, read from the bag on first use."""
        return read_loop(self.info.path)

    @cached_property
    def texts(self) -> TaskTexts | None:
        """What the run was made with, None if the bag does not carry it or carries something else."""
        urdf, schedule = self.info.urdf_text, self.info.schedule_text
        if urdf is None or schedule is None:
            return None
        depth = self.info.parameters.get(PLANT, {}).get(_CONTACT_DEPTH)
        texts = TaskTexts(urdf, schedule, float(depth) if isinstance(depth, int | float) else CONTACT_DEPTH)
        return texts if texts.fit(self.data) else None

    @property
    def law(self) -> str:
        """Return the control law in the bag, 'unknown' if there is none."""
        return str(self.info.parameters.get(CONTROLLER, {}).get("law", UNKNOWN_LAW))

    @property
    def tolerance(self) -> GraspTolerance | None:
        """Return the grasp tolerance, None if the bag lacks it."""
        plant = self.info.parameters.get(PLANT, {})
        values = [*(plant.get(name) for name in _TOLERANCES), plant.get(_RATE_TOLERANCE, inf)]
        numbers = [float(value) for value in values if isinstance(value, int | float)]
        return GraspTolerance(*numbers) if len(numbers) == len(values) else None


def read_recorded(name: str, bag: Path) -> RecordedRun:
    """Return the run in a bag; raises ConfigurationError if the bag is damaged or holds no run."""
    try:
        run = RecordedRun(name, read_run(bag), read_info(bag))
        _ = run.info.parameters, run.info.ledger  # parsed on first use: raise their errors here
    except BagError as error:
        raise ConfigurationError(str(error)) from error
    return run


def compare_recorded(runs: Sequence[RecordedRun]) -> Comparison:
    """Return the comparison of recorded runs, with all that their bags carry."""
    return compare(
        {run.name: run.data for run in runs},
        laws={run.name: run.law for run in runs},
        loops={run.name: run.loop for run in runs},
        texts={run.name: run.texts for run in runs if run.texts},
    )


def common_tolerance(runs: Sequence[RecordedRun]) -> GraspTolerance | None:
    """Return the grasp tolerance if it was the same in all runs, else None."""
    found = {run.tolerance for run in runs}
    return found.pop() if len(found) == 1 else None
