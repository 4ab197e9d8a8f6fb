"""A recording per run: one bag is closed, whole, before the next is opened, and commands tell them apart."""

from pathlib import Path

import pytest

from sms_handover.bag.recording import Recording
from sms_handover.bag.repair.check import check
from sms_handover.bag.run_recordings import RunRecordings
from sms_handover.errors import BagError, ConfigurationError
from sms_handover.launcher.run_folder import bag_of, bags_of


def nothing(recording: Recording) -> None:
    """Tell nothing in a bag."""


def test_every_run_has_a_folder_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "bag_3").mkdir()  # of somebody else: it is left alone
    described: list[Path] = []
    recordings = RunRecordings(tmp_path / "bag", lambda recording: described.append(recording.writer.folder))
    recordings.add_topic("/clock", "rosgraph_msgs/msg/Clock", period_ns=10_000_000)
    recordings.current.begin()
    message = bytes([0, 1, 0, 0, *bytes(8)])
    for count in (1, 2, 3):
        for number in range(count):
            stamp = (10_000_000 * number).to_bytes(4, "little")
            recordings.current.receive("/clock", message[:8] + stamp, 0)
        if count < 3:
            assert recordings.begin_next().topics[0].received == count
    assert recordings.close().topics[0].received == 3
    assert recordings.close().topics[0].received == 3
    assert recordings.complete
    assert described == [tmp_path / name for name in ("bag", "bag_2", "bag_4")]
    for count, folder in enumerate(described, 1):
        assert check(folder).counts == {"/clock": count}
    assert list((tmp_path / "bag_3").iterdir()) == []


def test_a_gap_in_any_run_is_not_forgotten(tmp_path: Path) -> None:
    recordings = RunRecordings(tmp_path / "bag", nothing)
    recordings.add_topic("/clock", "rosgraph_msgs/msg/Clock", period_ns=10_000_000)
    for stamp_ns in (0, 20_000_000):
        message = bytes([0, 1, 0, 0, *bytes(4)]) + stamp_ns.to_bytes(4, "little")
        recordings.current.receive("/clock", message, 0)
    assert not recordings.begin_next().complete
    recordings.close()
    assert not recordings.complete


def test_the_first_folder_must_be_new(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    with pytest.raises(BagError, match="exists already"):
        RunRecordings(tmp_path / "bag", nothing)


def test_commands_find_the_bags_of_a_run_that_was_reset(tmp_path: Path) -> None:
    for name in ("bag", "bag_2", "bag_10", "bag_recovered", "log"):
        (tmp_path / name).mkdir()
    assert bags_of(tmp_path) == tuple(tmp_path / name for name in ("bag", "bag_2", "bag_10"))
    assert bag_of(tmp_path / "bag_2") == tmp_path / "bag_2"
    with pytest.raises(ConfigurationError, match="has the bags of 3 runs; name one of"):
        bag_of(tmp_path)
