"""Page of a report: recorded runs as one HTML document."""

from collections.abc import Sequence

from sms_handover import __version__
from sms_handover.analysis.highlights import highlights
from sms_handover.analysis.table import figure_sections
from sms_handover.errors import ConfigurationError
from sms_handover.report.animation import animation
from sms_handover.report.cards import run_card
from sms_handover.report.clearance_plot import clearance_plots
from sms_handover.report.engine import plotly_script, render, web_file
from sms_handover.report.page_data import page_data
from sms_handover.report.plots import plot_groups
from sms_handover.report.provenance import compared_parameters, compared_versions, schedule_difference
from sms_handover.report.recorded_run import RecordedRun, common_tolerance, compare_recorded
from sms_handover.report.security import content_security_policy, inline_scripts
from sms_handover.report.styles import run_styles

_SCRIPTS = ("data.js", "colours.js", "theme.js", "plot.js", "link.js", "main.js")


def report_page(runs: Sequence[RecordedRun]) -> str:
    """Return the report of recorded runs as one self-contained HTML document.

    Raises ConfigurationError if there is no run, or two have the same name.
    """
    names = [run.name for run in runs]
    if not runs:
        raise ConfigurationError("a report needs at least one run")
    if len(set(names)) < len(names):
        raise ConfigurationError(f"runs of a report must have different names, these are {names}")
    comparison = compare_recorded(runs)
    styles = run_styles(names, [run.law for run in runs])
    infos, data = [run.info for run in runs], [run.data for run in runs]
    clearances = [comparison.runs[name].clearance for name in names]
    groups = (*plot_groups(data), clearance_plots(data, clearances))
    moving = animation(runs, clearances)
    scripts = (plotly_script(), "\n".join(web_file(name) for name in _SCRIPTS))
    return render(
        "report.html.j2",
        title=_title(names),
        version=__version__,
        policy=content_security_policy((*scripts, *inline_scripts(moving.html))),
        style=web_file("report.css"),
        scripts=scripts,
        runs=[
            run_card(run, style, comparison.runs[run.name].completion)
            for run, style in zip(runs, styles, strict=True)
        ],
        highlights=highlights(comparison),
        sections=figure_sections(comparison, common_tolerance(runs)),
        claims=comparison.claims,
        plot_groups=groups,
        data=page_data(data, styles, groups),
        animation=moving,
        versions=compared_versions(infos),
        parameters=compared_parameters(infos),
        schedules=[info.schedule_text for info in infos],
        schedule_difference=schedule_difference(infos, names),
    )


def _title(names: Sequence[str]) -> str:
    *others, last = names
    return f"{', '.join(others)} and {last}, side by side" if others else last
