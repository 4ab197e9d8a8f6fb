"""Parameters of the viewer."""

from dataclasses import dataclass

from sms_handover.configuration.parameters import parameter


@dataclass(frozen=True)
class ViewerParameters:
    """Parameters of the live view; their values are in ``config/viewer.yaml``."""

    port: int = parameter("port of the page on this machine; 0: any free one", minimum=0, maximum=65_535)
    frame_rate: float = parameter(
        "frames per second of simulation time", unit="1/s", minimum=0.1, maximum=1000.0
    )
    browser: bool = parameter("open the page in a browser")
