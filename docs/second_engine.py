"""Page on second engines: how far every shipped scenario is from what they compute of it."""

from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path

from docs.tables import table
from sms_handover.configuration.scenario_file import scenario_names
from sms_handover.engines.protocol import Engine
from sms_handover.engines.registry import ENGINES, load_engine
from sms_handover.engines.verdict import Verdict, verdict_of
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate

QUANTITIES = {
    "joints": "rad",
    "base position": "m",
    "base attitude": "rad",
    "tool position": "m",
    "tool attitude": "rad",
    "linear momentum": "kg m/s",
    "angular momentum": "kg m^2/s",
    "deputy position": "m",
    "deputy attitude": "rad",
    "impulse": "N s",
    "impulsive moment": "N m s",
}
HEAD = ("Scenario", "Engine", *(f"{quantity} [{unit}]" for quantity, unit in QUANTITIES.items()))
_HEAD_LINES = 2
PAGE = Path(__file__).resolve().parent / "second_engine.md"


def verdicts(scenarios: Sequence[str], engines: Sequence[Engine]) -> dict[str, list[Verdict]]:
    """Return by scenario what every engine says of its run in one process."""
    found = {}
    for name in scenarios:
        scenario = load_scenario(name)
        run = simulate(scenario)
        found[name] = [verdict_of(engine, run, scenario, name) for engine in engines]
        for verdict in found[name]:
            print(name, *verdict.lines(), sep="\n", flush=True)
    return found


def measured(found: dict[str, list[Verdict]], engines: Sequence[Engine], earlier: str) -> str:
    """Return the table: a row per scenario and engine, the largest difference with its bound in each cell.

    Scenarios that were not run keep the rows that they have in an ``earlier`` page.
    """
    rows = {
        name: [row for row in earlier.splitlines() if row.startswith(f"| `{name}` |")]
        for name in scenario_names()
    }
    for name, each in found.items():
        lines = []
        for engine, verdict in zip(engines, each, strict=True):
            cells = {d.quantity: f"{d.largest:.1e} (≤ {d.bound:.0e})" for d in verdict.differences}
            words = [cells.get(quantity, "") for quantity in QUANTITIES]
            if verdict.unsupported:
                words[0] = f"not supported: {verdict.unsupported}"
            lines.append((f"`{name}`", engine.title, *words))
        rows[name] = table(HEAD, lines).splitlines()[_HEAD_LINES:]
    return "\n".join([table(HEAD, ()), *(row for each in rows.values() for row in each)])


def page(rows: str) -> str:
    """Return the page around the table."""
    limits = "\n".join(
        f"| {name} | {effect.value} | {why} |"
        for name in ENGINES
        for effect, why in load_engine(name).lacks.items()
    )
    return f"""\
# A second engine on any run

`sms-handover verify RUN --with mujoco` (or `basilisk`) takes the robot out of the bag of a run, gives it
the recorded efforts from the recorded start, and lets the other engine integrate. Nothing corrects it on
the way: every difference of equations, numbers or integrators adds up over the run. Base, joints, tools and
momenta are compared each reference period, by the kinematics and the sums of the other engine.

```sh
pip install 'sms_handover[mujoco]'        # or [basilisk], in an environment of its own
sms-handover run smooth -o runs/smooth
sms-handover verify runs/smooth --with mujoco
sms-handover verify runs/smooth --with mujoco --json
sms-handover report runs/smooth --with mujoco   # the verdict as a line of the page
```

Exit code 0: every difference is within its bound. 1: one is beyond. 5: the run has something that the
engine does not know, said in one line.

- **MuJoCo** gets the MJCF that `bag robot` writes, with the rotor inertia of the description in the bag,
  and integrates with its RK4 in steps of the tick.
- **Basilisk** gets a hub with a chain of spinning bodies per arm, links that fixed joints hold together as
  one body, and integrates with its RK4 in steps of the tick. Its initial position is that of the centre of
  mass of the whole.

A deputy **with mass** floats in MuJoCo as a body of its own, from its initial pose and twist. At a grasp it
becomes a child of the hand at the relative pose that MuJoCo finds, and the run goes on from the velocities
after the impulse, which MuJoCo computes by its own mass matrices and which is compared with that of the
event; a release makes it a body of its own again. A deputy without mass, a missed grasp and a release of it
move nothing, so they need no replay.

**Conditions**: errors of torques, commands that are late or lost and a model that errs are in the recorded
efforts and in the description of the bag. Wrenches from outside are computed from the state that MuJoCo has.

A replay is open loop. Where neighbouring motions part exponentially, as with a law that does not know what
the hand carries and throws its wrist about, rounding grows beyond any bound; the two engines then agree up
to there, which the times in the list show.

## Bounds and what was measured

The bounds are stated per scenario (`sms_handover/engines/bounds.py`). A run in which the deputy has mass has
those of `massive` unless its scenario has its own, another scenario that is not shipped those of `paper`.
They notice what they are for: 0.1 % more mass of any one link is beyond those of `smooth` within two seconds
(`test/verification/test_second_engine.py`). Largest differences over a whole run, under the law of the
scenario, written by `make engines` (`make engines SCENARIOS=tight` writes the rows of one anew):

{rows}

## What an engine does not know

| Engine | Effect | Why |
|---|---|---|
{limits}
"""


def main() -> int:
    """Replay shipped scenarios in every engine, and write the page; other scenarios keep their rows."""
    parser = ArgumentParser(description=main.__doc__)
    parser.add_argument("names", nargs="*", metavar="SCENARIO", help="default: all that are shipped")
    parser.add_argument("--with", dest="engines", nargs="+", choices=tuple(ENGINES), default=tuple(ENGINES))
    options = parser.parse_args()
    engines = [load_engine(name) for name in options.engines]
    found = verdicts(options.names or scenario_names(), engines)
    if options.engines == tuple(ENGINES):
        rows = measured(found, engines, PAGE.read_text(encoding="utf-8"))
        PAGE.write_text(page(rows), encoding="utf-8")
    return 0 if all(v.agrees or v.unsupported for each in found.values() for v in each) else 1


if __name__ == "__main__":
    raise SystemExit(main())
