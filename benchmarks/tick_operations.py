"""Operations of the equations in a tick in C: a count that no other process disturbs."""

from typing import Any

import casadi

from sms_handover.compiled.resisted_functions import ResistedFunctions
from sms_handover.compiled.source import acceleration_of, efforts_of, symbols_of, with_parameters
from sms_handover.compiled.tree import body_tree
from sms_handover.simulation.scenario import Scenario

_NOT_COUNTED = (casadi.OP_INPUT, casadi.OP_OUTPUT, casadi.OP_CONST)
LATER_STAGES = 3  # of the scheme of order 4


def operations(ideal: Scenario, nominal: Scenario) -> dict[str, tuple[int, int]]:
    """Return how many operations the parts of a tick of nmpc have, ideal and with friction and model error.

    An ideal law finds the factors of H that the first stage needs. Friction is solved by one pass here; each
    further one has its factors and acceleration again.
    """
    known, truth = body_tree(nominal.model.robot), body_tree(nominal.truth.robot)
    turn, v, _ = symbols_of(truth)
    resisted = ResistedFunctions(turn, v, *with_parameters(truth))
    inertia, factors, held = map(_count, resisted.functions)
    by, conditioned = acceleration_of(body_tree(ideal.truth.robot)), acceleration_of(truth)
    prepared, own = (_count(efforts_of(known, prepared=first)) for first in (True, False))
    return {
        "law, which finds factors of H for the plant where truth and model are one": (prepared, own),
        "H and c of the plant, for friction": (0, inertia),
        "factors of H, for friction": (0, factors),
        "acceleration of the first stage": (_count(by.first), held),
        f"accelerations of {LATER_STAGES} later stages": (
            LATER_STAGES * _count(by.later),
            LATER_STAGES * _count(conditioned.later),
        ),
    }


def _count(function: Any) -> int:
    """Return the number of operations of a function that is written out."""
    kinds = (function.instruction_id(index) for index in range(function.n_instructions()))
    return sum(kind not in _NOT_COUNTED for kind in kinds)
