"""Figures of runs for print, drawn with matplotlib, which no other part of the package imports."""

from importlib.util import find_spec

from sms_handover.errors import MissingDependencyError

if find_spec("matplotlib") is None:
    raise MissingDependencyError("figures", "matplotlib", "analysis")
