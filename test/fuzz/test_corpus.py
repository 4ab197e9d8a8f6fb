"""What is kept in the corpus is read or refused, and so is a sample of what the fuzzers try."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, settings

from sms_handover.errors import SmsHandoverError

from .campaign import bounded
from .mutations import mutated
from .targets import CORPUS, TARGETS, Target

MOST_BYTES = 10**6  # of the whole corpus
SAMPLE = 25  # inputs of each fuzzer


def attempt(target: Target, data: bytes, folder: Path) -> None:
    """Run a target, which may refuse the input by an error of ours and in no other way."""
    try:
        with bounded():
            target.run(data, folder)
    except SmsHandoverError:
        pass


@pytest.mark.parametrize(
    "path", sorted(CORPUS.glob("*/*")), ids=lambda path: f"{path.parent.name}/{path.name}"
)
def test_what_is_kept_is_read_or_refused(path: Path, tmp_path: Path) -> None:
    attempt(TARGETS[path.parent.name], path.read_bytes(), tmp_path)


@pytest.mark.parametrize("target", TARGETS.values(), ids=list(TARGETS))
def test_a_sample_of_the_fuzzer(target: Target, tmp_path: Path) -> None:
    """The same inputs every time: CI is to find what a change breaks, `make fuzz` what is broken."""

    @settings(
        max_examples=SAMPLE,
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(mutated(target.corpus))
    def sample(data: bytes) -> None:
        attempt(target, data, tmp_path)

    sample()


def test_the_corpus_is_small_and_every_target_has_a_good_input(tmp_path: Path) -> None:
    assert sum(path.stat().st_size for path in CORPUS.glob("*/*")) < MOST_BYTES
    assert {path.name for path in CORPUS.iterdir()} == set(TARGETS)
    for name, target in TARGETS.items():
        good = [path for path in (CORPUS / name).iterdir() if path.name.startswith("good")]
        assert good, name
        for path in good:
            target.run(path.read_bytes(), tmp_path)
