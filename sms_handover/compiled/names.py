"""Names of the C functions that are made for a kind of robot."""

COMPUTED_TORQUE, PREPARED_TORQUE = "sms_computed_torque", "sms_prepared_torque"
EFFORTS = "sms_efforts"
TOOLS, TOOL_JACOBIANS = "sms_tools", "sms_tool_jacobians"
MOTION, CONSERVED = "sms_motion", "sms_conserved"
INERTIA, FACTORS, HELD = "sms_inertia", "sms_factors", "sms_held"
OBSERVE, RESISTED_STEP, SETTLE = "sms_observe", "sms_resisted_step", "sms_settle"
TICKS, WORK_SIZE = "sms_ticks", "sms_work_size"  # the loop, and the numbers that it needs room for


LINEARISATION = "sms_linearisation"


def rest_name(scheme: str) -> str:
    """Return the name of the function that steps by a scheme after its first stage has been prepared."""
    return f"sms_rest_{scheme}"


def loaded_name(arm: int) -> str:
    """Return the name of the law's function where truth and model differ in what an arm carries alone."""
    return f"sms_loaded_torque_{arm}"


def held_name(scheme: str) -> str:
    """Return the name of the function that steps by a scheme from the acceleration of its first stage on."""
    return f"sms_held_{scheme}"


def step_name(scheme: str) -> str:
    """Return the name of the function that steps by a scheme."""
    return f"sms_step_{scheme}"


TOOL_ROWS, MOTION_ROWS, FIND_JOINTS = "sms_tool_rows", "sms_motion_rows", "sms_find_joints"
PERIODS, ON_PATH, RESOLVE_RATES = "sms_periods", "sms_on_path", "sms_resolve_rates"
GENERALIZED_JACOBIAN, CARRIED = "sms_generalized_jacobian", "sms_carried"
WITHOUT_DRIFT, PLACED = "sms_without_drift", "sms_placed"
