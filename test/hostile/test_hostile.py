"""A sample of what ``make hostile`` tries: the same each time, and every command in it."""

import pytest

from .command import tried

SAMPLE = 20  # attempts, as many as there are commands


@pytest.mark.system
@pytest.mark.parametrize("seed", range(SAMPLE))
def test_a_command_ends_in_words_wherever_it_is_started(seed: int) -> None:
    assert tried(seed) == ""
