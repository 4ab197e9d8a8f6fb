"""Main program of a solver process: solves the problems that come through a socket, until that is closed."""

import pickle
import signal
import sys
from contextlib import suppress
from multiprocessing.connection import Connection

from sms_handover.clearance.distances import ClearanceModel
from sms_handover.compiled.linearisation import CompiledDerivatives
from sms_handover.control.mpc.plan_problem import PlanProblem
from sms_handover.control.mpc.plan_solver import PlanSolver
from sms_handover.errors import SmsHandoverError
from sms_handover.model.robot_model import RobotModel
from sms_handover.simulation.near_pairs import NearPairs
from sms_handover.simulation.solver_process import READY, SolverSetup, packed

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


def make_solver(setup: SolverSetup) -> PlanSolver:
    """Return a solver; raises ConfigurationError."""
    robot = RobotModel(setup.robot)
    clearance = ClearanceModel(robot.pin, robot.urdf, robot.arms, setup.deputy.size)
    return PlanSolver(robot, setup.deputy, setup.gains, NearPairs(clearance), CompiledDerivatives)


def main() -> int:
    """Serve until the other end of the socket is closed; signals to the group are for its process."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    with Connection(int(sys.argv[1])) as link, suppress(EOFError, OSError):
        try:
            solver = make_solver(pickle.loads(link.recv_bytes()))
            link.send_bytes(READY)
            while True:
                problem: PlanProblem = pickle.loads(link.recv_bytes())
                link.send_bytes(packed(solver.solve(problem)))
        except SmsHandoverError as error:
            print(f"solver process: error: {error}", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
