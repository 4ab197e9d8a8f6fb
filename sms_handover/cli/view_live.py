"""``sms-handover view --live``: a running graph in 3D; apart from view, which needs no ROS."""

from argparse import Namespace

from sms_handover.cli.node_options import given, run_in_process
from sms_handover.nodes.viewer import main as run_viewer

_PARAMETERS = {"port": "port", "frame_rate": "frame_rate"}


def follow(options: Namespace) -> int:
    """Run the viewer node in this process until it is interrupted; return the exit code."""
    values = given(options, _PARAMETERS)
    if options.no_browser:
        values["browser"] = False
    return run_in_process(run_viewer, options, values)
