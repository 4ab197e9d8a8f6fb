"""Folder of a campaign: only its own rows and a manifest that can be, and what stands in the way is named."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from sms_handover.campaign.cases.case_row import Task
from sms_handover.campaign.definition.frozen import freeze
from sms_handover.campaign.record.campaign_folder import CampaignFolder, open_campaign
from sms_handover.campaign.record.journal import JOURNAL, Entry, JournalWriter
from sms_handover.campaign.record.kept_cases import keep_worst
from sms_handover.campaign.record.manifest import Shard
from sms_handover.cli.main import main
from sms_handover.errors import ConfigurationError, SmsHandoverError

from .campaigns import STUB, WHOLE, begun, made_up, rows_of, run_here, written


def test_rows_of_another_campaign_are_no_rows_of_this_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A journal that was copied, one of before lines named their campaign, and rows that cannot be."""
    frozen = begun(tmp_path / "out", range(3))
    begun(tmp_path / "part", range(0, 6, 2), Shard(1, 2))
    other, number = freeze(written(tmp_path / "other", cases=6, seed=4))
    with open_campaign(tmp_path / "theirs", other, number, WHOLE) as opened:
        opened.add(made_up(0))
    path, own = tmp_path / "out" / JOURNAL, (tmp_path / "out" / JOURNAL).read_bytes()
    line, measured = made_up(0), '{"cpu": 0.0, "host": "nowhere", "solve": null, "tries": 1, "wall": 0.1}'
    check = hashlib.sha256(f"{line.row.text}\n{measured}".encode()).hexdigest()[:16]
    before = f'{{"row":{line.row.text},"beside":{measured},"check":"{check}"}}\n'.encode() * 2
    names = [digest[:16] for digest in (frozen.digest, other.digest)]
    for journal, told in (
        ((tmp_path / "theirs" / JOURNAL).read_bytes(), f"line 1 is of campaign {names[1]}, not of campaign"),
        (
            own + before,
            f"line 4 is of an earlier edition, which named none, not of campaign {names[0]}",
        ),
    ):
        path.write_bytes(journal)
        assert main(["campaign", "status", str(path.parent)]) == 2
        (error,) = capsys.readouterr().err.splitlines()
        assert f"{path}, {told}" in error
        with pytest.raises(ConfigurationError, match=told):
            open_campaign(path.parent, frozen, 6, WHOLE)
        assert path.read_bytes() == journal and not (path.parent / "broken.jsonl").exists()
    foreign = [Task(0, "smooth", "pid"), Task(0, "rough", "nmpc"), Task(-1, "smooth", "nmpc")]
    places = [*((tmp_path / "out", task) for task in foreign), (tmp_path / "part", Task(1, "smooth", "nmpc"))]
    for folder, task in places:
        (folder / JOURNAL).write_bytes(b"")
        writer = JournalWriter(folder / JOURNAL, frozen.digest)
        writer.add(Entry(replace(line.row, task=task), line.beside))
        writer.close()
        with pytest.raises(
            ConfigurationError, match=f"a row of {task}, which is not of this campaign, shard 1"
        ):
            rows_of(folder)
    begun(tmp_path / "more", [7])
    assert [task.case for task in rows_of(tmp_path / "more")] == [7], "as of a campaign that had more cases"


MANIFESTS: Sequence[tuple[object, str]] = (
    ({"cases": "x"}, "cases is 'x', must be a whole number"),
    ({"cases": 2.5}, "cases is 2.5, must be a whole number"),
    ({"cases": -5}, "cases is -5, must be >= 1"),
    ({"cases": 0}, "cases is 0, must be >= 1"),
    ({"cases": 1e30}, "cases is 1e+30, must be"),
    ({"cases": 10**9}, "cases is 1000000000, must be >= 1 and <= 100000000"),
    ({"cases": None}, "cases is null, of sampler random must be a whole number from 1 to 100000000"),
    ({"shard": {"number": 0, "of": 0}}, "shard.of is 0, must be >= 1"),
    ({"shard": {"number": 3, "of": 2}}, "shard.number is 3, must be >= 1 and <= 2"),
    ({"shard": {"number": 1}}, "shard has no key 'of', must have number, of"),
    ({"shard": 3}, "shard is 3, must be a mapping"),
    ({"sessions": [{"a": 1}]}, "sessions[0] has no key 'start', must have start, host"),
    ({"sessions": [{"start": "x", "host": 3}]}, "sessions[0].host is 3, must be text"),
    ({"sessions": "x"}, "sessions is 'x', must be a list"),
    ({"extra": 1}, "manifest: unknown key 'extra': known are 'digest', 'name', 'cases', 'shard', 'sessions'"),
    ({"digest": 5}, "digest is 5, must be 64 hexadecimal digits"),
    ({"name": 5}, "name is 5, must be text"),
    ([1], "manifest is [1], must be a mapping"),
)


def test_a_manifest_that_cannot_be_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    begun(tmp_path / "out", ())
    path = tmp_path / "out" / "manifest.json"
    good = json.loads(path.read_text())
    texts = [(json.dumps({**good, **one} if isinstance(one, dict) else one), told) for one, told in MANIFESTS]
    del good["name"]
    more = [(json.dumps(good), "manifest has no key 'name', must have digest, name,"), ("[" * 10**5, "")]
    for text, told in (*texts, *more):
        path.write_text(text)
        assert main(["campaign", "status", str(path.parent)]) == 2, text[:80]
        (error,) = capsys.readouterr().err.splitlines()
        assert str(path) in error and told in error, (told, error)
    fixed = freeze(written(tmp_path / "grid", sampler={"grid": {"levels": 3}}, cases=None))
    with open_campaign(tmp_path / "fixed", *fixed, WHOLE) as opened:
        assert opened.cases == 3
    path = tmp_path / "fixed" / "manifest.json"
    path.write_text(path.read_text().replace('"cases": null', '"cases": 5'))
    with pytest.raises(ConfigurationError, match="cases is 5, of sampler grid must be null: it has its own"):
        assert CampaignFolder(path.parent).campaign


def test_what_stands_in_the_way_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file where a folder must be, or a folder where a file must be."""
    frozen, out, file = begun(tmp_path / "out"), tmp_path / "out", tmp_path / "plain"
    file.touch()
    (tmp_path / "half" / JOURNAL).mkdir(parents=True)
    for target, code, told in (
        (file, 2, f"{file} exists: merge into a new folder"),
        (file / "x", 1, f"{file / 'x'} cannot be written: {file} is no folder; once it can, the same"),
        (tmp_path / "half", 1, f"{tmp_path / 'half' / JOURNAL} cannot be written: Is a directory; once"),
    ):
        assert main(["campaign", "merge", str(out), "-o", str(target)]) == code
        (error,) = capsys.readouterr().err.splitlines()
        assert told in error and "[Errno" not in error
    (out / "broken.jsonl").mkdir()
    with (out / JOURNAL).open("ab") as stream:
        stream.write(b"{}\n")
    with pytest.raises(SmsHandoverError, match=r"broken.jsonl cannot be written: Is a directory"):
        open_campaign(out, frozen, 6, WHOLE)
    (out / JOURNAL).unlink()
    (out / JOURNAL).mkdir()
    for words in (["campaign", "status"], ["compare"], ["campaign", "rerun"]):
        assert main([*words, str(out), *(["0"] if words[-1] == "rerun" else [])]) == 2
        assert f"{out / JOURNAL} cannot be read: Is a directory" in capsys.readouterr().err
    bags = written(tmp_path / "bags", cases=1, keep={"worst": 1, "worst_as": "bag"})
    run_here(bags, tmp_path / "kept", program=STUB)
    (tmp_path / "kept" / "bags").touch()
    told = f"nmpc cannot be written: {tmp_path / 'kept' / 'bags'} is no folder; once it can"
    assert told in list(keep_worst(CampaignFolder(tmp_path / "kept"), lambda *_: None))[-1].text
