"""Random streams: nothing but seed, case and name moves them."""

from itertools import combinations

import numpy as np
import pytest

from sms_handover.conditions.random_streams import RandomStreams

_NAMES = ("torque.noise_density", "command.dropped", "friction", "a", "b")


def test_the_numbers_of_a_tick_do_not_depend_on_which_others_were_drawn() -> None:
    ticks = [0, 1, 1023, 1024, 5000, 2]
    in_order = RandomStreams(7).noise("a", 3)
    numbers = {k: (in_order.normal(k), in_order.uniform(k)) for k in range(5001)}
    jumping = RandomStreams(7).noise("a", 3)
    for tick in ticks:
        assert np.array_equal(jumping.normal(tick), numbers[tick][0])
        assert np.array_equal(jumping.uniform(tick), numbers[tick][1])
    distinct = {tuple(normal.tolist()) for normal, _ in numbers.values()}
    assert len(distinct) == len(numbers)


def test_streams_of_models_cases_and_seeds_and_of_parameters_and_noise_are_apart() -> None:
    draws = [
        RandomStreams(seed, case).noise(name, 4).normal(0)
        for seed in (0, 1)
        for case in (0, 1)
        for name in _NAMES
    ]
    draws += [RandomStreams(0).parameters(name).standard_normal(4) for name in _NAMES]
    draws += [RandomStreams(0).noise(name, 4).uniform(0) for name in _NAMES]
    draws += [RandomStreams(0).parameters(name).random(4) for name in _NAMES]
    for first, second in combinations(draws, 2):
        assert not np.any(first == second)


def test_the_stream_is_what_numpy_says_of_seed_and_key() -> None:
    """So that another program can draw the same numbers: Philox from SeedSequence(seed, (case, digest))."""
    sequence = RandomStreams(11, 4).sequence("a")
    assert sequence.entropy == 11
    assert sequence.spawn_key[0] == 4
    generator = np.random.Generator(np.random.Philox(RandomStreams(11, 4).sequence("b/parameters")))
    assert generator.random() == RandomStreams(11, 4).parameters("b").random()


@pytest.mark.parametrize("left", range(3))
def test_numbers_are_standard(left: int) -> None:
    noise = RandomStreams(left).noise("a", 50)
    normal = np.concatenate([noise.normal(k) for k in range(400)])
    assert normal.mean() == pytest.approx(0.0, abs=0.04)
    assert normal.std() == pytest.approx(1.0, abs=0.03)
