"""Nodes, one a file: parameters, messages in, a call of the core, messages out."""

import sys

from sms_handover.errors import ConfigurationError
from sms_handover.ros.process.environment import prepare_environment

try:  # before any of them imports rclpy; a command or a launcher has done it, and reported it
    prepare_environment(private=False)
except ConfigurationError as error:
    print(f"error: {error}", file=sys.stderr)
    raise SystemExit(2) from None
