"""Clearance over time: every sampled distance is the model's, and the worst pair is what a rule says."""

import numpy as np
import pytest

from sms_handover.analysis.clearance import RunClearance, TaskTexts, run_clearance
from sms_handover.analysis.clearance_series import ClearanceSeries, GroupSeries, SeriesOfGroups
from sms_handover.clearance.bodies import Body, BodyKind
from sms_handover.clearance.distances import ClearanceModel, NearestPoints
from sms_handover.clearance.worst_pair import NearestRecord, WorstPair
from sms_handover.report.clearance_plot import CEILING, MOST_GROUPS, clearance_plots
from sms_handover.report.plots import POINTS
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import Scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import Array, Pose

from .conftest import MakeScenario
from .test_analysis_runs import make_run

GRIPPER, DEPUTY = Body("arm_a_gripper", BodyKind.GRIPPER, "arm_a"), Body("deputy", BodyKind.DEPUTY)
BASE, LINK = Body("base_link", BodyKind.BASE), Body("arm_a_link_3", BodyKind.LINK, "arm_a")
DEPTH = 0.001  # [m]


@pytest.fixture
def scenario(make_scenario: MakeScenario) -> Scenario:
    return make_scenario()


@pytest.fixture
def run(scenario: Scenario) -> RunData:
    return simulate(scenario)


@pytest.fixture
def series(run: RunData, scenario: Scenario) -> ClearanceSeries:
    found = run_clearance(run, TaskTexts(scenario.truth.robot.urdf, scenario.truth.schedule.text)).series
    assert found is not None
    return found


def test_distances_over_time_are_those_of_the_model(
    series: ClearanceSeries, run: RunData, scenario: Scenario
) -> None:
    """Measured again one by one, from another start of coal's search, which ends within 1e-6 m."""
    robot, size = scenario.truth.robot, scenario.truth.schedule.deputy.size
    model = ClearanceModel(robot.pin, robot.urdf, run.arms, size)
    assert np.array_equal(series.stamp_ns, run.reference_ns)
    for row in (0, 30, len(series.stamp_ns) - 1):
        tick = int(np.searchsorted(run.tick_ns, series.stamp_ns[row]))
        q = np.concatenate([run.base_pose[tick], run.joint_position[tick]])
        deputy = Pose(run.deputy_pose[row, :3], run.deputy_pose[row, 3:])
        distances = model.distances(q, deputy)
        least = np.nanmin([group.distance[row] for group in series.groups])
        assert least == pytest.approx(distances.min(), abs=2e-6)
        worst = series.worst_pair
        assert worst.distance[row] == pytest.approx(distances[worst.pair[row]], abs=2e-6)


def test_points_are_as_far_apart_as_the_distance_says(series: ClearanceSeries) -> None:
    apart = np.linalg.norm(np.diff(series.worst_pair.points_in_world, axis=1)[:, 0], axis=1)
    assert np.allclose(apart, np.abs(series.worst_pair.distance), atol=1e-6)


class Measured:
    """A model of three pairs, of which the second may touch; its points tell which pair they are of."""

    pairs = ((BASE, LINK), (GRIPPER, DEPUTY), (LINK, DEPUTY))

    def nearest_points(self, pair: int) -> NearestPoints:
        """Return points that all have the number of the pair as coordinates."""
        return NearestPoints(np.full((2, 3), float(pair)), np.array([1.0, 0.0, 0.0]))


@pytest.mark.parametrize(
    ("distances", "declared", "worst"),
    [
        ((0.5, 0.3, 0.4), False, 1),
        ((0.2, 0.3, 0.4), False, 0),
        ((0.5, -0.0009, 0.4), True, 2),  # an allowed contact does not count
        ((0.5, 0.0, 0.4), True, 2),
        ((0.5, -0.0011, 0.4), True, 1),  # deeper than allowed
        ((0.5, -0.0009, 0.4), False, 1),
        ((0.5, -0.02, -0.0195), True, 2),  # both collide: the contact by 19 mm, the link by 19.5 mm
    ],
)
def test_a_declared_contact_is_the_worst_pair_only_if_it_is_too_deep(
    distances: tuple[float, ...], declared: bool, worst: int
) -> None:
    found = worst_of(np.array([distances]), declared)
    assert found.pair.tolist() == [worst] and found.distance.tolist() == [distances[worst]]
    assert np.array_equal(found.points_in_world, np.full((1, 2, 3), float(worst)))


def worst_of(distances: Array, declared: bool) -> WorstPair:
    record = NearestRecord(Measured())  # type: ignore[arg-type]
    for row in distances:
        record.keep(row)
    allowed = np.tile([False, declared, False], (len(distances), 1))
    return record.worst(np.arange(len(distances)) * 10, distances, allowed, DEPTH)


def test_other_instants_are_unknown() -> None:
    known = worst_of(np.array([[0.5, 0.3, 0.4], [0.1, 0.3, 0.4], [0.5, 0.6, 0.4]]), declared=False)
    found = known.at(np.array([5, 10, 20, 99]))
    assert found.pair[1:3].tolist() == [0, 2] and found.distance[1:3].tolist() == [0.1, 0.4]
    assert np.isnan(found.distance[[0, 3]]).all() and np.isnan(found.points_in_world[[0, 3]]).all()
    assert np.isnan(worst_of(np.empty((0, 3)), declared=False).at(np.array([5])).distance).all()


def test_the_stages_of_a_contact_are_one_line() -> None:
    sampled = np.array([[0.4, 0.3], [0.2, -0.0005], [0.5, 0.1]])
    rows = np.array([False, True, False])
    groups = SeriesOfGroups(sampled)
    groups.add("gripper arm_a - deputy, before grasp", 0.0, 0.1, [(1, ~rows)])
    groups.add("gripper arm_a - deputy, held (contact)", -DEPTH, 0.0005, [(1, rows)])
    groups.add("base - arm_a", 0.0, 0.2, [(0, np.ones(3, dtype=bool))])
    near, far = groups.groups()
    assert (near.name, near.margin, far.name) == ("gripper arm_a - deputy", 0.0005, "base - arm_a")
    assert near.distance.tolist() == sampled[:, 1].tolist() and groups.allowed == -DEPTH
    assert groups.declared.tolist() == [[False, False], [False, True], [False, False]]


def test_the_plot_has_the_worst_groups_of_any_run_in_bounded_size() -> None:
    """Two made-up runs of one minute and one without clearance: a line per group, in mm, with its levels."""
    run = make_run()
    count = len(run.reference_ns)
    names = [f"group {number}" for number in range(MOST_GROUPS + 2)]
    found: list[RunClearance | None] = []
    for least in (0.05, -0.01):
        groups = tuple(
            GroupSeries(name, np.linspace(least + place, 1.0 + place, count), least + place)
            for place, name in enumerate(names)
        )
        worst = WorstPair(
            run.reference_ns,
            (("a", "b"),),
            np.zeros(count, dtype=np.int64),
            np.zeros(count),
            np.zeros((count, 2, 3)),
        )
        found.append(RunClearance((), ClearanceSeries(run.reference_ns, groups, -DEPTH, worst)))
    (plot,) = clearance_plots([run, run, run], [*found, None]).plots
    assert plot.series == tuple(names[:MOST_GROUPS]) and plot.ceiling == CEILING
    assert [level.value for level in plot.levels] == [0.0, -1.0]
    assert {(line.run, line.series) for line in plot.lines} == {
        (number, series) for number in (0, 1) for series in range(MOST_GROUPS)
    }
    lowest = next(line for line in plot.lines if (line.run, line.series) == (1, 0))
    assert lowest.values[0] == pytest.approx(-10.0) and lowest.time[-1] == 60.0
    assert all(len(line.time) <= 7 * POINTS for line in plot.lines)
    assert clearance_plots([run], [None]).plots[0].lines == ()
