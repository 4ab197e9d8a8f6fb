"""Random streams of a campaign, one per case and dotted path, so that no draw moves another."""

import numpy as np

from sms_handover.conditions.random_streams import RandomStreams

_GRID = 2**52  # shares are the middles of so many cells, so that none is 0 or 1
_RUN_SEED = "seed"  # stands for the seed of the run, which every stream inside the run follows from
_DESIGN = "design"
_LARGEST_SEED = 2**53


def stream(seed: int, case: int, name: str) -> np.random.Generator:
    """Return the stream of a name in a case, made as those of the models of a run are."""
    return RandomStreams(seed, case).parameters(name)


def share_of(seed: int, case: int, name: str) -> float:
    """Return the uniform draw in (0, 1) of a name in a case."""
    return (int(stream(seed, case, name).integers(_GRID)) + 0.5) / _GRID


def run_seed(seed: int, case: int) -> int:
    """Return the seed of the runs of a case, the same under every law and in every scenario."""
    return int(stream(seed, case, _RUN_SEED).integers(_LARGEST_SEED))


def design_seed(seed: int) -> int:
    """Return the seed of a design, which spreads all cases together."""
    return int(RandomStreams(seed).sequence(_DESIGN).generate_state(1, np.uint32)[0])
