"""Fields of the schedule of a task, and of the deputy that is a section of it."""

from sms_handover.configuration.field_specification import (
    FLOATS,
    EitherSpec,
    ListSpec,
    MappingSpec,
    NamedSpec,
    ValueSpec,
    text,
    vector,
)
from sms_handover.configuration.robot_fields import BOX_OR_MOMENTS, COM, pose

HOLD, TARGET_KINDS = "hold", ("joints", "tool_in_world", "grasp_frame")
MOST_RETRIES = 100  # of one phase; more is a mistake rather than patience
_SHORTEST = 1e-9  # [s]
_HEAVIEST = 1e5  # [kg] beyond, the inertia of the arms is lost in rounding

DEPUTY_FIELDS = MappingSpec(
    "the object that is handed over",
    {
        "mass": ValueSpec("mass; 0: massless, as in the paper", "kg", minimum=0.0, maximum=_HEAVIEST),
        "size": vector(3, "edges along x, y, z", "m", above=0.0),
        "in_world": pose("its pose at 0 s"),
        "grasp_frames": NamedSpec(
            "frames that a tool which holds it coincides with", pose("grasp frame in the deputy")
        ),
    },
    {
        "com": COM,
        "inertia": BOX_OR_MOMENTS,
        "twist_in_world": MappingSpec(
            "twist of its origin at 0 s, in axes of world; what is not given of it is zero",
            optional={
                "linear": vector(3, "velocity", "m/s"),
                "angular": vector(3, "angular velocity", "rad/s"),
            },
        ),
    },
)
_FRAME = text("a grasp frame of the deputy")
_JOINTS = ValueSpec("joint angles of the arm", "rad", kind=FLOATS)
_TARGET = EitherSpec(
    text("where the arm goes; hold: it keeps its joint angles", (HOLD,)),
    MappingSpec(
        "where the arm goes",
        optional={
            "joints": _JOINTS,
            "tool_in_world": pose("pose of the tool in world"),
            "grasp_frame": _FRAME,
            "tool_in_grasp_frame": pose("pose of the tool in the grasp frame"),
        },
        one_of=TARGET_KINDS,
    ),
)
_EVENT = MappingSpec(
    "a command at the first instant of the phase",
    optional={
        "grasp": MappingSpec("the arm closes on the frame", {"arm": text("the arm"), "grasp_frame": _FRAME}),
        "release": MappingSpec("the arm lets go", {"arm": text("the arm")}),
        "transfer": MappingSpec(
            "one arm lets go and the other closes on the frame in the same instant",
            {"from": text("the arm that lets go"), "to": text("the arm that closes"), "grasp_frame": _FRAME},
        ),
    },
    one_of=("grasp", "release", "transfer"),
)
_ON_MISS = EitherSpec(
    text("what to do if a grasp of the phase misses", ("continue", "abort")),
    MappingSpec(
        "repeat the phase before",
        {"retry": ValueSpec("most retries", minimum=1, maximum=MOST_RETRIES, kind=int)},
    ),
)
_PHASE = MappingSpec(
    "a phase, which starts where the one before ends",
    {
        "name": text("unique name"),
        "duration": ValueSpec("duration, a multiple of the reference period", "s", minimum=_SHORTEST),
        "arms": NamedSpec("target of every arm", _TARGET),
    },
    {
        "start": ValueSpec("when it starts, which must be the end of the one before", "s", minimum=0.0),
        "motion": ValueSpec(
            "time that a smooth time law takes to the target, at most and by default the duration",
            "s",
            minimum=_SHORTEST,
        ),
        "events": ListSpec("grasp commands at its first instant", _EVENT),
        "on_miss": _ON_MISS,
        "gains": NamedSpec(
            "by control law, gains that replace those of the controller during the phase",
            NamedSpec("gains of the law", ValueSpec("gain, as in the controller's parameters", kind=object)),
        ),
    },
)
SCHEDULE_FIELDS = MappingSpec(
    "who does what when",
    {
        "initial": MappingSpec(
            "state at 0 s, at rest",
            {
                "base_in_world": pose("pose of base_link"),
                "joints": NamedSpec("joint angles of every arm", _JOINTS),
            },
        ),
        "deputy": DEPUTY_FIELDS,
        "phases": ListSpec("the phases in the order of time", _PHASE, shortest=1),
    },
)
