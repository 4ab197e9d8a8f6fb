"""Plots of a campaign: success over cases, distributions, the trade between laws, maps over two draws."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sms_handover.campaign.cases.case_metrics import USUAL
from sms_handover.campaign.definition.campaign_file import Campaign
from sms_handover.campaign.statistics.case_columns import CaseColumns, Group
from sms_handover.campaign.statistics.pareto import pareto_front
from sms_handover.campaign.statistics.proportion import proportion
from sms_handover.campaign.statistics.sensitivity import sensitivities
from sms_handover.report.page_data import packed
from sms_handover.types import Array

LINE, POINTS, BARS = "line", "points", "bars"
_MOST_POINTS = 2000  # [-] of a trace; of more a part, evenly taken
_BINS = 40  # [-]
_SAME = 1e-9  # [-] share of the values by which they differ in their last bits only
_TRADES = (("base_turn", "grasp_error"), ("control_effort", "grasp_error"))


@dataclass(frozen=True, eq=False)
class Trace:
    """One trace of a plot: points or a line x, y (N,) with bounds if given, in the colour of a law.

    ``front`` marks what is drawn larger, ``success`` what is drawn full.
    """

    kind: str
    name: str
    colour: int
    x: Array
    y: Array
    low: Array | None = None
    high: Array | None = None
    full: Array | None = None
    large: Array | None = None

    @property
    def data(self) -> dict[str, object]:
        """The trace as the script of the page reads it."""
        arrays = {name: getattr(self, name) for name in ("x", "y", "low", "high", "full", "large")}
        packs = {name: packed(array) for name, array in arrays.items() if array is not None}
        return {"kind": self.kind, "name": self.name, "colour": self.colour, **packs}


@dataclass(frozen=True, eq=False)
class CampaignPlot:
    """A plot with its traces and the titles of its axes."""

    key: str
    title: str
    x: str
    y: str
    traces: tuple[Trace, ...]

    @property
    def data(self) -> dict[str, object]:
        """The plot as the script of the page reads it."""
        traces = [trace.data for trace in self.traces]
        return {"key": self.key, "x": self.x, "y": self.y, "traces": traces}


def campaign_plots(campaign: Campaign, columns: Mapping[Group, CaseColumns]) -> tuple[CampaignPlot, ...]:
    """Return the plots of each scenario, but those of which no case has the metrics."""
    found: list[CampaignPlot] = []
    for scenario in campaign.scenarios:
        laws = [(law, columns[scenario, law]) for law in campaign.laws if (scenario, law) in columns]
        if laws:
            found.append(_convergence(scenario, laws))
            found.append(_distribution(scenario, laws, campaign.worst_by))
            found += [_trade(scenario, laws, *trade) for trade in _TRADES]
            for colour, (law, one) in enumerate(laws):
                found += _map(campaign, scenario, law, one, colour)
    return tuple(plot for plot in found if plot.traces)


def _convergence(scenario: str, laws: Sequence[tuple[str, CaseColumns]]) -> CampaignPlot:
    """Return the success over the number of cases, with its interval."""
    traces = []
    for colour, (law, one) in enumerate(laws):
        places = np.unique(np.linspace(1, len(one.case), min(len(one.case), 200)).astype(int))
        sums = np.cumsum(one.succeeded)
        shares = [proportion(int(sums[place - 1]), int(place)) for place in places]
        numbers = ([getattr(share, name) for share in shares] for name in ("share", "low", "high"))
        y, low, high = (100.0 * np.array(each) for each in numbers)
        traces.append(Trace(LINE, law, colour, places.astype(float), y, low, high))
    title = f"{scenario}: success so far, with Wilson's 95 % interval"
    return CampaignPlot(f"convergence-{scenario}", title, "cases", "success [%]", tuple(traces))


def _distribution(scenario: str, laws: Sequence[tuple[str, CaseColumns]], metric: str) -> CampaignPlot:
    """Return how often a metric has which value."""
    known = [one.metrics.get(metric, np.empty(0)) for _, one in laws]
    known = [values[~np.isnan(values)] for values in known]
    every = np.concatenate(known)
    traces = []
    if every.size:
        edges = np.histogram_bin_edges(every, _BINS, _range(every))
        middles = (edges[1:] + edges[:-1]) / 2.0
        for colour, ((law, _), values) in enumerate(zip(laws, known, strict=True)):
            traces.append(Trace(BARS, law, colour, middles, np.histogram(values, edges)[0].astype(float)))
    return CampaignPlot(
        f"distribution-{scenario}", f"{scenario}: {metric}", _axis(metric), "cases", tuple(traces)
    )


def _range(values: Array) -> tuple[float, float]:
    """Return the range of a histogram; of values that hardly differ it is as wide as they are large."""
    low, high = float(values.min()), float(values.max())
    size = max(abs(low), abs(high))
    half = (size or 1.0) / 2.0
    return (low - half, high + half) if high - low <= _SAME * size else (low, high)


def _trade(scenario: str, laws: Sequence[tuple[str, CaseColumns]], x: str, y: str) -> CampaignPlot:
    """Return two costs against each other; what is on the Pareto front of its law is large."""
    traces = []
    for colour, (law, one) in enumerate(laws):
        if x in one.metrics and y in one.metrics:
            costs = np.column_stack([one.metrics[x], one.metrics[y]])
            if np.isnan(costs).any(axis=1).all():
                continue
            front = pareto_front(costs)
            keep = _thinned(len(costs)) | front
            flags = (one.succeeded[keep].astype(float), front[keep].astype(float))
            points = costs[keep]
            trace = Trace(POINTS, law, colour, points[:, 0], points[:, 1], full=flags[0], large=flags[1])
            traces.append(trace)
    title = f"{scenario}: {y} against {x}, the Pareto front large, what is no success hollow"
    return CampaignPlot(f"trade-{x}-{scenario}", title, _axis(x), _axis(y), tuple(traces))


def _map(
    campaign: Campaign, scenario: str, law: str, one: CaseColumns, colour: int
) -> tuple[CampaignPlot, ...]:
    """Return successes and failures of a law over the two drawn values that matter most under it."""
    if len(one.inputs) < 2:
        return ()
    found = sensitivities(campaign, one, campaign.worst_by)
    size = {item.path: -abs(item.first) if item.first == item.first else 0.0 for item in found}
    x, y = sorted(one.inputs, key=lambda path: size.get(path, 0.0))[:2]
    keep = _thinned(len(one.case))
    full = one.succeeded[keep].astype(float)
    trace = Trace(POINTS, law, colour, one.inputs[x][keep], one.inputs[y][keep], full=full)
    title = f"{scenario}: cases under {law} over two draws, what is no success hollow"
    return (CampaignPlot(f"map-{law}-{scenario}", title, x, y, (trace,)),)


def _thinned(count: int) -> np.ndarray:
    """Return which of so many points are drawn."""
    keep = np.zeros(count, dtype=np.bool_)
    keep[:: max(1, -(-count // _MOST_POINTS))] = True
    return keep


def _axis(metric: str) -> str:
    """Return the title of the axis of a metric."""
    return f"{metric} [{USUAL[metric][0]}]" if metric in USUAL else metric
