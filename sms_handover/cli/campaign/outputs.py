"""Outputs of a campaign folder, told line by line; bags are made by the verb that a user would take."""

import subprocess
import sys
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from signal import SIGINT

from sms_handover.campaign.cases.case_row import Task
from sms_handover.campaign.record.campaign_folder import CampaignFolder
from sms_handover.campaign.record.outputs import write_outputs
from sms_handover.cli.exit_codes import EXIT_OK
from sms_handover.errors import SmsHandoverError
from sms_handover.launcher.process_sessions import SessionGuard, end_sessions
from sms_handover.launcher.processes import as_program

_END_S = 3.0  # [s] that an interrupted recording has to end by itself
_KILL_S = 1.0  # [s] until it is killed after that


def has_ros() -> bool:
    """Whether cases can be run as graphs here."""
    return find_spec("rclpy") is not None


def tell_outputs(path: Path) -> bool:
    """Write table, page and worst cases of a folder, and tell of each; return whether all could be made."""
    is_whole = True
    for output in write_outputs(path, record_case if has_ros() else None):
        print(output.text, file=sys.stderr if output.is_lacking else sys.stdout, flush=True)
        is_whole = is_whole and not output.is_lacking
    return is_whole


def record_case(folder: CampaignFolder, task: Task, output: Path) -> None:
    """Run a case over DDS and record it to a new folder, in a process of its own, which alone knows ROS.

    Raises SmsHandoverError with its last line unless the recording is there and equal to the row.
    """
    words = ["campaign", "rerun", str(folder.path), str(task.case), "--law", task.law]
    words += ["--scenario", task.scenario, "--bag", "--output", str(output)]
    guard = SessionGuard()  # ends it should this process be killed
    child = subprocess.Popen(
        [*as_program("sms_handover.cli.main"), *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        start_new_session=True,  # Ctrl-C is for this process, which ends it
    )
    guard.add(child.pid)
    try:
        said, _ = child.communicate()
    except BaseException:
        child.send_signal(SIGINT)
        with suppress(subprocess.TimeoutExpired):
            child.wait(_END_S)
        end_sessions({child.pid}, _KILL_S)
        child.wait()
        raise
    finally:
        guard.close()
    if child.returncode != EXIT_OK:
        lines = [line.strip() for line in said.splitlines() if line.strip()]
        raise SmsHandoverError(lines[-1] if lines else f"it ended with exit code {child.returncode}")
