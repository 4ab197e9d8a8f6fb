"""Parameters of the recorder."""

from dataclasses import dataclass

from sms_handover.parameters import parameter


@dataclass(frozen=True)
class RecorderParameters:
    """Where and what to record; the values are in ``config/recorder.yaml``."""

    folder: str = parameter("new folder for the bag; empty: handover_<date>_<time> in the current folder")
    record_all: bool = parameter("record topics beyond those of the graph too")
    niceness: int = parameter(
        "how far the recorder stands back behind the loop for the processor, as in nice(1)",
        minimum=0,
        maximum=19,
    )
    drain_timeout: float = parameter(
        "wall time without any message after which the end is not waited for", unit="s", minimum=0.1
    )
