"""Services of the nodes as data: who offers what, who calls it, and what it does.

A name with ``~/`` is private: ``~/pause`` of the node ``plant`` is ``plant/pause``.
"""

from dataclasses import dataclass

from sms_handover.graph.topics import IK, PLANT, PLAYER, SOLVE_IK, TRAJECTORY


@dataclass(frozen=True)
class Service:
    """One service: name as its node declares it, type, the node that offers it and those that call it."""

    name: str
    type: str
    server: str
    clients: tuple[str, ...]
    does: str

    @property
    def relative_name(self) -> str:
        """The name as others call it, within the namespace of the graph."""
        return self.name.replace("~", self.server, 1)


_TRIGGER = "std_srvs/srv/Trigger"
_OURS = "sms_handover_interfaces/srv"

SERVICES = (
    Service(
        SOLVE_IK,
        f"{_OURS}/SolveIK",
        IK,
        (TRAJECTORY,),
        "joint positions that bring the tools to their targets with the base locked",
    ),
    Service("~/pause", "std_srvs/srv/SetBool", PLANT, (), "true: hold the run at this tick; false: go on"),
    Service("~/step", f"{_OURS}/StepTicks", PLANT, (), "let a plant paused in lock step do some ticks"),
    Service("~/reset", _TRIGGER, PLANT, (), "start the run again at time zero"),
    Service("~/finish", _TRIGGER, PLANT, (), "end the run at this tick, so that the recorder closes its bag"),
    Service("~/pause", _TRIGGER, PLAYER, (), "hold the playback"),
    Service("~/resume", _TRIGGER, PLAYER, (), "go on"),
    Service("~/toggle_paused", _TRIGGER, PLAYER, (), "hold or go on"),
    Service("~/play_next", _TRIGGER, PLAYER, (), "send one message of a playback that is held"),
    Service("~/stop", _TRIGGER, PLAYER, (), "end the playback"),
    Service("~/set_rate", f"{_OURS}/SetRate", PLAYER, (), "change the seconds of the bag per wall second"),
    Service("~/seek", f"{_OURS}/Seek", PLAYER, (), "go on from another time of the bag"),
)
