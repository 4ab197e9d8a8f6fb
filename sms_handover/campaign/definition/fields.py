"""Fields of a campaign file: which runs, what is drawn, what counts as success, and when to stop."""

from sms_handover.configuration.field_specification import (
    FLOATS,
    TEXTS,
    EitherSpec,
    ListSpec,
    MappingSpec,
    NamedSpec,
    ValueSpec,
    text,
)

RANDOM, LHS, SOBOL = "random", "lhs", "sobol"
GRID, MORRIS, SALTELLI, LIST = "grid", "morris", "saltelli", "list"
COUNTED = (RANDOM, LHS, SOBOL)  # samplers that take the number of cases; the others have their own
EXTENDABLE = (RANDOM, SOBOL)  # whose cases stay when more are added
MORRIS_LEVELS = 4  # [-] by default, as its authors have it
NONE, FAILURES, ALL = "none", "failures", "all"
DATA, BAG = "data", "bag"
MOST_CASES = 100_000_000
_MOST_LEVELS = 100_000  # of a grid, each of which is computed beforehand
_LARGEST = 2**53  # from which on not every whole number is a double

_NUMBER = {kind: ValueSpec(kind) for kind in ("mean", "low", "high")}
_MEAN, _LOW, _HIGH = _NUMBER["mean"], _NUMBER["low"], _NUMBER["high"]
_STD = ValueSpec("standard deviation; 0: always the mean", minimum=0.0)
_WHOLE = ValueSpec("bound, itself included", minimum=-_LARGEST, maximum=_LARGEST, kind=int)
DISTRIBUTION_FIELDS = MappingSpec(
    "how a value is drawn, in the unit of the value",
    optional={
        "normal": MappingSpec("normal distribution", {"mean": _MEAN, "std": _STD}),
        "truncated": MappingSpec(
            "normal distribution within bounds", {"mean": _MEAN, "std": _STD, "low": _LOW, "high": _HIGH}
        ),
        "uniform": MappingSpec("uniform distribution", {"low": _LOW, "high": _HIGH}),
        "integers": MappingSpec("whole numbers, all alike", {"low": _WHOLE, "high": _WHOLE}),
        "choice": MappingSpec(
            "one of some values",
            {"values": ValueSpec("a list of numbers, texts or true and false", kind=object)},
            {"weights": ValueSpec("weight of each value; alike by default", minimum=0.0, kind=FLOATS)},
        ),
    },
    one_of=("normal", "truncated", "uniform", "integers", "choice"),
)
_CORRELATED = MappingSpec(
    "normal draws that depend on each other",
    {
        "draws": NamedSpec(
            "by dotted path", MappingSpec("normal distribution", {"mean": _MEAN, "std": _STD})
        ),
        "correlation": ValueSpec("matrix of correlations in the order of the draws", kind=object),
    },
)
_VALUES = NamedSpec("values by dotted path", ValueSpec("value", kind=object))
_SAMPLER = EitherSpec(
    text("how cases are spread; random: each draw by itself; lhs, sobol: evenly", COUNTED),
    MappingSpec(
        "a design, which has its own number of cases",
        optional={
            GRID: MappingSpec(
                "all combinations",
                {"levels": ValueSpec("quantiles of each draw", minimum=1, maximum=_MOST_LEVELS, kind=int)},
            ),
            MORRIS: MappingSpec(
                "elementary effects [Morris1991]",
                {"trajectories": ValueSpec("number of trajectories", minimum=2, maximum=10_000, kind=int)},
                {
                    "levels": ValueSpec(
                        f"levels of each draw, even; by default {MORRIS_LEVELS}",
                        minimum=2,
                        maximum=100,
                        kind=int,
                    )
                },
            ),
            SALTELLI: MappingSpec(
                "variance-based indices [Saltelli2010]",
                {"base": ValueSpec("base samples, a power of two", minimum=2, kind=int)},
            ),
            LIST: MappingSpec("rows of a table", {"file": text("CSV file, its header the dotted paths")}),
        },
        one_of=(GRID, MORRIS, SALTELLI, LIST),
    ),
)
_STOP = MappingSpec(
    "stop early, looked at only after fixed numbers of cases; for the samplers random and sobol",
    {
        "half_width": ValueSpec(
            "of Wilson's 95 % interval of every law's success, from which it is enough",
            above=0.0,
            maximum=0.5,
        ),
        "looks": ValueSpec("numbers of cases, rising", minimum=1, kind=FLOATS),
    },
)
_KEEP = MappingSpec(
    "what is kept beyond a row per case",
    optional={
        "trajectories": text("50 Hz trajectories of which cases", (NONE, FAILURES, ALL)),
        "worst": ValueSpec(
            "that many worst cases of each law in each scenario, run again at the end",
            minimum=0,
            maximum=1000,
            kind=int,
        ),
        "worst_as": text("as what: data, all arrays; bag, recorded over DDS, which needs ROS", (DATA, BAG)),
    },
)
_LIMITS = MappingSpec(
    "limits of one case, beyond which it ends as a row with its cause",
    optional={
        "ticks": ValueSpec("ticks of the run; 0: as long as the scenario", minimum=0, kind=int),
        "wall_time": ValueSpec("wall time", "s", above=0.0),
        "memory": ValueSpec("resident memory of its process", "MB", above=0.0),
        "retries": ValueSpec("times to try again after its process died", minimum=0, maximum=10, kind=int),
    },
)
CAMPAIGN_FIELDS = MappingSpec(
    "many runs: scenarios x laws x drawn values",
    {
        "name": text("name of the campaign: letters, digits, _ and -"),
        "seed": ValueSpec("what every draw follows from", minimum=0, maximum=_LARGEST, kind=int),
        "scenarios": NamedSpec(
            "scenarios by a name of their own",
            EitherSpec(
                text("name of a shipped scenario, or path of a file"),
                MappingSpec(
                    "a scenario with values of its own",
                    {"scenario": text("name of a shipped scenario, or path of a file")},
                    {"values": _VALUES},
                ),
            ),
        ),
        "laws": ValueSpec("control laws, all of which get the same draws", kind=TEXTS),
    },
    {
        "description": text("what it is to show, in one line"),
        "cases": ValueSpec("number of cases", minimum=1, maximum=MOST_CASES, kind=int),
        "sampler": _SAMPLER,
        "values": _VALUES,
        "draws": NamedSpec("what is drawn, by dotted path", DISTRIBUTION_FIELDS),
        "correlated": ListSpec("groups of draws that depend on each other", _CORRELATED),
        "success": text("when a case is a success: an expression over metrics, by default 'complete'"),
        "metrics": ValueSpec("figures to keep beside the usual ones, as PHASE.ARM.FIGURE", kind=TEXTS),
        "worst_by": text(
            "metric by which cases are worst: the larger, but of clearance and complete the smaller; "
            "'grasp_error' by default"
        ),
        "stop": _STOP,
        "keep": _KEEP,
        "limits": _LIMITS,
    },
)
