"""Free-floating dual-arm handover: a ROS 2 graph and the numerical core it runs on.

``import sms_handover as sms`` is the front door: every name listed here is an attribute, imported when it is
first used, so that the import itself loads neither NumPy nor Pinocchio nor ROS (PEP 562). In a session
``dir(sms)`` lists them.
"""

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

# The one list of names, one per line: type checkers and editors read it, and so does _places() below.
if TYPE_CHECKING:
    from sms_handover.analysis.comparison import Comparison as Comparison
    from sms_handover.analysis.comparison import compare as compare
    from sms_handover.analysis.decimation import decimate as decimate
    from sms_handover.analysis.figures.draw import draw_figures as draw_figures
    from sms_handover.analysis.figures.draw import write_figure as write_figure
    from sms_handover.analysis.figures.drawn_run import DrawnRun as DrawnRun
    from sms_handover.analysis.metrics import RunMetrics as RunMetrics
    from sms_handover.analysis.metrics import measure as measure
    from sms_handover.analysis.records import Record as Record
    from sms_handover.analysis.records import records_of as records_of
    from sms_handover.analysis.signals import Signal as Signal
    from sms_handover.analysis.signals import signals_of as signals_of
    from sms_handover.analysis.summary import summary as summary
    from sms_handover.analysis.table import render as render
    from sms_handover.bag.run.loop_record import LoopRecord as LoopRecord
    from sms_handover.bag.run.loop_record import read_loop as read_loop
    from sms_handover.bag.run.reader import read_run as read_run
    from sms_handover.configuration.parameters import parameter as parameter
    from sms_handover.control.controller import JointController as JointController
    from sms_handover.control.distance_gradients import DistanceGradients as DistanceGradients
    from sms_handover.control.law import JointLaw as JointLaw
    from sms_handover.control.law import Law as Law
    from sms_handover.control.law import LawSetup as LawSetup
    from sms_handover.control.law import LinearFeedback as LinearFeedback
    from sms_handover.control.law import Need as Need
    from sms_handover.control.protocol import Controller as Controller
    from sms_handover.control.protocol import Guidance as Guidance
    from sms_handover.control.protocol import Resumable as Resumable
    from sms_handover.errors import ConfigurationError as ConfigurationError
    from sms_handover.errors import SmsHandoverError as SmsHandoverError
    from sms_handover.export.data_frames import data_frames as data_frames
    from sms_handover.external.controller import run_controller as run_controller
    from sms_handover.model.conserved import conserved_quantities as conserved_quantities
    from sms_handover.model.known_payload import KnownPayload as KnownPayload
    from sms_handover.model.poses import pose_distance as pose_distance
    from sms_handover.model.poses import pose_of as pose_of
    from sms_handover.model.poses import se3_of as se3_of
    from sms_handover.model.reduced import base_twist_per_joint_rate as base_twist_per_joint_rate
    from sms_handover.model.reduced import drift_of_momentum as drift_of_momentum
    from sms_handover.model.reduced import generalized_jacobian as generalized_jacobian
    from sms_handover.model.reduced import reduced_dynamics as reduced_dynamics
    from sms_handover.model.reduced import reduced_inverse_dynamics as reduced_inverse_dynamics
    from sms_handover.model.reduced import tool_jacobian as tool_jacobian
    from sms_handover.model.robot_model import RobotModel as RobotModel
    from sms_handover.plan_report import PlanReport as PlanReport
    from sms_handover.plan_report import PlanStatus as PlanStatus
    from sms_handover.previewed_targets import PreviewedTargets as PreviewedTargets
    from sms_handover.report.recorded_run import RecordedRun as RecordedRun
    from sms_handover.report.recorded_run import compare_recorded as compare_recorded
    from sms_handover.report.recorded_run import read_recorded as read_recorded
    from sms_handover.run_data import RunData as RunData
    from sms_handover.simulation.check import check_scenario as check_scenario
    from sms_handover.simulation.loop import Loop as Loop
    from sms_handover.simulation.observed_ticks import Observation as Observation
    from sms_handover.simulation.scenario import Scenario as Scenario
    from sms_handover.simulation.scenario import load_scenario as load_scenario
    from sms_handover.simulation.simulate import RunWithoutPlanError as RunWithoutPlanError
    from sms_handover.simulation.simulate import simulate as simulate
    from sms_handover.simulation.snapshot import Snapshot as Snapshot
    from sms_handover.simulation.snapshot import load_snapshot as load_snapshot
    from sms_handover.simulation.snapshot import save_snapshot as save_snapshot
    from sms_handover.types import BASE_NQ as BASE_NQ
    from sms_handover.types import BASE_NV as BASE_NV
    from sms_handover.types import Array as Array
    from sms_handover.types import GraspEvent as GraspEvent
    from sms_handover.types import GraspStatus as GraspStatus
    from sms_handover.types import JointReference as JointReference
    from sms_handover.types import Pose as Pose
    from sms_handover.types import TaskPhase as TaskPhase
else:  # hidden from type checkers, to whom a name that is not in the list is an error

    def _places() -> dict[str, str]:
        """Return the module of every name, read from the lines of the list above."""
        lines = __spec__.loader.get_source(__name__).splitlines()
        words = [line.split() for line in lines if line.startswith("    from ")]
        return {name: module for _, module, _, name, *_ in words}

    def __getattr__(name: str) -> object:
        """Import a name of the list when it is first used, and keep it."""
        module = None if name.startswith("_") else _places().get(name)
        if module is None:
            raise AttributeError(
                f"module {__name__!r} has no attribute {name!r}", name=name, obj=import_module(__name__)
            )
        value = getattr(import_module(module), name)
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        """List what there is, imported or not."""
        return sorted({*globals(), *_places()})
