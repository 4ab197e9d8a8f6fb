"""Text of what came of a campaign, and its figures as plain values."""

from collections.abc import Mapping
from dataclasses import asdict
from textwrap import fill
from typing import Any

import numpy as np

from sms_handover.analysis.layout import WIDTH, Section, layout
from sms_handover.campaign.definition.campaign_file import Campaign
from sms_handover.campaign.statistics.case_columns import CaseColumns, Group
from sms_handover.campaign.statistics.extent import Extent
from sms_handover.campaign.statistics.notes import PERCENTILES, note_on_sampler, note_on_stop, note_on_tests
from sms_handover.campaign.statistics.paired_tests import paired_tests
from sms_handover.campaign.statistics.percentiles import SHARES, percentile
from sms_handover.campaign.statistics.proportion import proportion
from sms_handover.campaign.statistics.tables import (
    KEY_METRICS,
    TEST_HEAD,
    TESTED,
    outcome_sections,
    paired_section,
)


def campaign_text(campaign: Campaign, columns: Mapping[Group, CaseColumns], extent: Extent) -> str:
    """Return extent and tables of a campaign, with a column per law; raises MissingDependencyError."""
    tests = paired_tests(columns, TESTED)
    lines = layout(campaign.laws, outcome_sections(campaign, columns))
    paired: Section | None = paired_section(tests)
    lines += layout(TEST_HEAD, [paired]) if paired else []
    stop = note_on_stop(campaign.stop, extent.stopped_at)
    notes = (PERCENTILES, note_on_sampler(campaign.sampler.kind), stop, note_on_tests(tests))
    lines += ["", *(fill(note, WIDTH) for note in notes if note)]
    return "\n".join([*extent.in_words, *lines]) + "\n"


def campaign_values(
    campaign: Campaign, columns: Mapping[Group, CaseColumns], extent: Extent
) -> dict[str, Any]:
    """Return the figures of a campaign, ready for ``json.dumps``; None where one is not defined.

    ``rows`` of ``runs`` are there; ``stopped_at`` is the number of cases after which it stopped early.
    """
    groups = []
    for (scenario, law), one in columns.items():
        successes = proportion(int(one.succeeded.sum()), len(one.case))
        metrics = {
            name: {
                "cases": int((~np.isnan(one.metrics[name])).sum()),
                **{
                    f"{share:g}": list(map(_plain, percentile(one.metrics[name], share)[:3]))
                    for share in SHARES
                },
            }
            for name in (*KEY_METRICS, *campaign.metrics)
            if name in one.metrics
        }
        groups.append(
            {
                "scenario": scenario,
                "law": law,
                "cases": len(one.case),
                "success": [successes.share, successes.low, successes.high],
                "numeric_failures": int(one.numeric_failure.sum()),
                "percentiles": metrics,
                "cpu": _plain(float(one.cpu.mean())),
            }
        )
    tests = [
        {name: _plain(value) if isinstance(value, float) else value for name, value in asdict(test).items()}
        for test in paired_tests(columns, TESTED)
    ]
    return {
        "campaign": campaign.name,
        "sampler": campaign.sampler.kind,
        "rows": extent.rows,
        "runs": extent.runs,
        "shard": str(extent.shard),
        "stopped_at": extent.stopped_at or None,
        "groups": groups,
        "paired_tests": tests,
    }


def _plain(value: float) -> float | None:
    """Return a number, None for NaN."""
    return None if np.isnan(value) else float(value)
