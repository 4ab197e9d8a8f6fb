"""Geometries page: how often each claim of the paper holds in random geometries that are possible."""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import cache, partial
from pathlib import Path

import matplotlib

matplotlib.use("svg")  # draws into a file; needs no display

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Rectangle

from docs.geometry_search import Tally, possible
from docs.geometry_trial import Bench
from docs.measurement_folder import KeptRows, measurement_folder
from docs.tables import table
from sms_handover.analysis.claims import PEAK_TORQUE
from sms_handover.campaign.statistics.proportion import proportion
from sms_handover.control.nmpc import NMPC
from sms_handover.control.pid import PID
from sms_handover.units import MM_PER_M

ROOT = Path(__file__).resolve().parent.parent
PAGE, FIGURE = ROOT / "docs" / "geometries.md", ROOT / "docs" / "images" / "geometries.svg"
SEED, COUNT = 16, 60
_FEW = 30  # [-] geometries below which the page says that there are few
_MOST_CAUSES = 8  # [-] rows of the table of failures


@dataclass(frozen=True)
class Row:
    """What came of one geometry, and of the candidates that failed before it."""

    index: int
    claims: dict[str, bool]
    peaks: dict[str, float]  # N m
    lead: float  # s
    least: float  # m
    rate: float  # [-] share of its limit
    simulated: int
    failures: dict[str, int]


@cache
def bench() -> Bench:
    """Return what all trials of a process share."""
    return Bench()


def measured(seed: int, index: int) -> tuple[Row, str]:
    """Return geometry number ``index`` of a seed and its schedule, whatever was drawn before it."""
    tally = Tally()
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))
    found = next(possible(bench(), random, tally, lambda line: None))
    trial = found.trial
    claims = {claim.name: bool(claim.holds) for claim in trial.claims}
    peaks = {law: float(peak) for law, peak in trial.peaks.items()} if trial.peaks else {}
    figures = (float(trial.lead), trial.least, trial.rate)
    return Row(index, claims, peaks, *figures, tally.simulated, dict(tally.failures)), found.text


def grown(seed: int, count: int, folder: Path, jobs: int = 1) -> list[Row]:
    """Return ``count`` rows; those that a folder lacks are worked out, ``jobs`` at a time, and appended."""
    kept = KeptRows(folder / f"rows_{seed}.jsonl")
    rows = [Row(**row) for row in kept.rows]
    if len(rows) >= count:
        return rows[:count]
    with ProcessPoolExecutor(jobs) as pool:
        for row, text in pool.map(partial(measured, seed), range(len(rows), count)):
            (folder / f"geometry_{seed}_{row.index}.yaml").write_text(text, encoding="utf-8")
            kept.add(asdict(row))
            rows.append(row)
            held = sum(row.claims.values())
            print(f"{row.index + 1} of {count}: {held} claims hold, {row.simulated} simulated", flush=True)
    return rows


def page(rows: Sequence[Row], seed: int) -> str:
    """Return the text of the page."""
    number = len(rows)
    simulated = sum(row.simulated for row in rows)
    claims = [(name, *_share(rows, name)) for name in rows[0].claims]
    all_hold = sum(all(row.claims.values()) for row in rows)
    _, _, low, high = proportion(all_hold, number)
    causes = Counter[str]()
    for row in rows:
        causes.update(row.failures)
    failures = [(cause, str(times)) for cause, times in causes.most_common(_MOST_CAUSES)]
    least = [row.least * MM_PER_M for row in rows]
    quartiles = [
        (label, *(f"{value:.2f}" for value in np.percentile(values, (0.0, 25.0, 50.0, 75.0, 100.0))))
        for label, values in (
            ("largest torque under NMPC [N m]", [row.peaks[NMPC.name] for row in rows]),
            ("largest torque under PID [N m]", [row.peaks[PID.name] for row in rows]),
            ("least lead of NMPC in settling [s]", [row.lead for row in rows]),
            ("largest rate, share of its limit", [row.rate for row in rows]),
            ("least distance, declared contacts too [mm]", least),
        )
    ]
    low_peak, high_peak = PEAK_TORQUE
    few = "" if number >= _FEW else f" {number} are too few to conclude anything from: mind the intervals."
    return f"""\
# Geometries

This page is written by `make geometries` ({COUNT} of them), this time by
`python -m docs.geometries --seed {seed} --count {number}`.
It goes on where it was stopped, with the same sources.{few}

The paper gives no pose: not where the deputy floats, not how the arms begin, not where they meet. Its claims
are judged on one geometry of ours, the scenario `paper`. This page asks how far they carry: {number} random
geometries, each of which is possible, none of which was chosen for what the claims come to.

## Which geometries

Drawn at random (`docs/geometry_candidates.py`): the deputy 1.0 to 1.2 m in front of the spacecraft's centre,
on A's side, its long edge within 30 degrees of level or upright; where the arms meet; where B takes it,
always away from A's gripper; how the tools are turned in the grasp frames; the joints of both arms at the
start. The arms come along the face of the deputy, by a sweep about their joints 1: the paper's targets jump,
PID overshoots them by tenths of a metre, and an arm that came straight at the deputy would go through it.
Robot, gains, tick and the three phases of 20 s are those of `paper`.

Possible means: targets in reach, the task completed under both laws with every grasp made, no two bodies that
touch at any reference period, joints within their limits of position and rate. The claim of completion asks
for more: that B ends settled on its final pose, where PID may still ring. Most candidates are not possible:
{simulated} were simulated for these {number}; one that fails is drawn anew in the phase in which it failed.
Where they failed most often:

{table(["Phase and cause", "Candidates"], failures)}

## How often the claims hold

The interval is Wilson's, 95 %.

{table(["Claim", "Holds", "Share", "Interval"], claims)}

All six hold in {all_hold} of {number}, {_percent(all_hold / number)} ({_percent(low)} to {_percent(high)}).

![Share of the geometries in which each claim holds, and the largest torques](images/geometries.svg)

{table(["Figure", "least", "25 %", "median", "75 %", "largest"], quartiles)}

## What depends on the pose

- **overshoot, final_error and completion** compare or bound what the laws themselves do.
- **peak_torque** is a statement on the size of the motion, not on the law: both torques grow with how far
  the joints go, under NMPC also with the inertia that they move. "Around 2.0 N m", read as {low_peak:g} to
  {high_peak:g} N m, picks motions of about the paper's size; smaller ones need less.
- **settling** and **drift** need motions that PID is slow to damp. PID settles a light wrist sooner than
  NMPC settles anything under T_r = 2 s; it rings where a joint moves much inertia, as in wide sweeps of a
  whole arm.

These are reasons, not measurements. A claim that holds in some geometries only says as much about the pose,
which the paper does not give. The distribution is ours too: other limits of the draws give other shares.
"""


def draw(rows: Sequence[Row], file: Path) -> None:
    """Draw the shares with their intervals, and the torques under both laws."""
    matplotlib.rcParams.update({"svg.hashsalt": "sms_handover", "svg.fonttype": "none"})
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.4), layout="constrained")
    names = list(rows[0].claims)
    for place, name in enumerate(names):
        held = sum(row.claims[name] for row in rows)
        _, _, low, high = proportion(held, len(rows))
        left.plot([100.0 * low, 100.0 * high], [place, place], color="0.4", linewidth=2.0)
        left.plot(100.0 * held / len(rows), place, "o", color="tab:blue")
    left.set_yticks(range(len(names)), names)
    left.invert_yaxis()
    left.set_xlim(-2.0, 102.0)
    left.set_xlabel("geometries in which the claim holds [%]")
    for whole, colour, label in ((True, "tab:blue", "all six hold"), (False, "tab:orange", "not all hold")):
        some = [row.peaks for row in rows if all(row.claims.values()) is whole]
        x, y = ([peaks[law] for peaks in some] for law in (NMPC.name, PID.name))
        right.plot(x, y, "o", color=colour, label=label, markersize=4.0)
    right.add_patch(Rectangle((PEAK_TORQUE[0],) * 2, *(PEAK_TORQUE[1] - PEAK_TORQUE[0],) * 2, alpha=0.15))
    right.set_xlabel("largest torque under NMPC [N m]")
    right.set_ylabel("largest torque under PID [N m]")
    right.legend()
    figure.savefig(file, metadata={"Date": None})
    plt.close(figure)


def _share(rows: Sequence[Row], claim: str) -> tuple[str, str, str]:
    """Return in how many geometries a claim holds, as number, share and interval."""
    held = sum(row.claims[claim] for row in rows)
    _, _, low, high = proportion(held, len(rows))
    return f"{held} of {len(rows)}", _percent(held / len(rows)), f"{_percent(low)} to {_percent(high)}"


def _percent(share: float) -> str:
    """Return a share in percent."""
    return f"{100.0 * share:.0f} %"


def main(arguments: list[str]) -> None:
    """Find the geometries and write page and figure."""
    parser = argparse.ArgumentParser(prog="python -m docs.geometries", description=__doc__)
    parser.add_argument("--seed", type=int, default=SEED, help="of every random number")
    parser.add_argument("--count", type=int, default=COUNT, help="geometries on the page")
    parser.add_argument("-j", "--jobs", type=int, default=2, help="geometries at the same time")
    options = parser.parse_args(arguments)
    rows = grown(options.seed, options.count, measurement_folder("geometries"), options.jobs)
    draw(rows, FIGURE)
    PAGE.write_text(page(rows, options.seed), encoding="utf-8")
    print(f"{PAGE.name} written")


if __name__ == "__main__":
    main(sys.argv[1:])
