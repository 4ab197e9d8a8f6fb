"""Analysis of runs: signals over time, metrics per phase and arm, the paper's claims, tables.

``docs/analysis.md`` has an example to start from, ``docs/metrics.md`` defines every figure.
"""

from sms_handover.analysis.comparison import Comparison, compare
from sms_handover.analysis.decimation import decimate
from sms_handover.analysis.metrics import RunMetrics, measure
from sms_handover.analysis.records import Record, records_of
from sms_handover.analysis.signals import Signal, signals_of
from sms_handover.analysis.summary import summary
from sms_handover.analysis.table import comparison_table, render
from sms_handover.bag.run.loop_record import LoopRecord, read_loop
from sms_handover.bag.run.reader import read_run
from sms_handover.run_data import RunData

__all__ = [
    "Comparison",
    "LoopRecord",
    "Record",
    "RunData",
    "RunMetrics",
    "Signal",
    "compare",
    "comparison_table",
    "decimate",
    "measure",
    "read_loop",
    "read_run",
    "records_of",
    "render",
    "signals_of",
    "summary",
]
