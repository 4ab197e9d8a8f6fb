"""Samples of a campaign: the drawn values of every case."""

from collections.abc import Mapping
from functools import cached_property

from sms_handover.campaign.definition.campaign_file import Campaign
from sms_handover.campaign.definition.distributions import Value
from sms_handover.campaign.definition.fields import COUNTED, GRID, LIST, RANDOM
from sms_handover.campaign.definition.sampler import cases_of
from sms_handover.campaign.sampling.designs import combination, design, grid
from sms_handover.campaign.sampling.streams import design_seed, share_of
from sms_handover.errors import ConfigurationError
from sms_handover.types import Array


class Samples:
    """The values of each case; those of a random sampler do not depend on how many there are."""

    def __init__(self, campaign: Campaign) -> None:
        """Take the draws of a campaign."""
        self._campaign, self._sampler = campaign, campaign.sampler

    @property
    def count(self) -> int:
        """The number of cases; raises ConfigurationError where it is not given."""
        if self._sampler.kind not in COUNTED:
            return cases_of(self._sampler, list(self._campaign.draws.values()))
        if self._campaign.cases is None:
            raise ConfigurationError(
                f"campaign {self._campaign.name!r} has no number of cases: give the key 'cases'"
            )
        return self._campaign.cases

    def inputs(self, case: int) -> dict[str, Value]:
        """Return the drawn values of a case by dotted path."""
        campaign, kind = self._campaign, self._sampler.kind
        if kind == LIST:
            return dict(self._sampler.rows[case])
        if kind == GRID:
            return dict(zip(campaign.draws, combination(self._columns, case), strict=True))
        shares = self.shares(case)
        values: dict[str, Value] = {path: one.quantile(shares[path]) for path, one in campaign.draws.items()}
        for group in campaign.groups:
            values.update(group.values([shares[path] for path in group.normals]))
        return values

    def shares(self, case: int) -> Mapping[str, float]:
        """Return the share in (0, 1) that each draw of a case is the quantile of."""
        paths = self._campaign.paths
        if self._sampler.kind == RANDOM:
            return {path: share_of(self._campaign.seed, case, path) for path in paths}
        return dict(zip(paths, self.design[case].tolist(), strict=True))

    @cached_property
    def design(self) -> Array:
        """The shares of all cases (cases, paths) of a sampler that spreads them together."""
        sampler, seed = self._sampler, design_seed(self._campaign.seed)
        cases = self.count if sampler.kind in COUNTED else None
        return design(sampler.kind, dict(sampler.numbers), cases, len(self._campaign.paths), seed)

    @cached_property
    def _columns(self) -> list[tuple[Value, ...]]:
        return grid(list(self._campaign.draws.values()), self._sampler.numbers["levels"])
