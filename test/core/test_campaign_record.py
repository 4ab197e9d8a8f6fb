"""Record of a campaign on disk: what is kept is whole, and whatever ends a command, the same one goes on."""

import json
import os
import random
from collections.abc import Callable
from dataclasses import replace
from errno import ENOSPC
from pathlib import Path

import pytest

from sms_handover.campaign.cases.case_process import Done
from sms_handover.campaign.cases.case_row import Beside
from sms_handover.campaign.definition.frozen import Frozen, freeze
from sms_handover.campaign.record.campaign_folder import CampaignFolder, merge, open_campaign
from sms_handover.campaign.record.journal import JOURNAL, Entry, JournalFaults, JournalWriter, entries_of
from sms_handover.campaign.record.manifest import Shard
from sms_handover.campaign.record.outputs import write_outputs
from sms_handover.cli.main import main
from sms_handover.errors import ConfigurationError, SmsHandoverError

from .campaigns import STUB, WHOLE, begun, digests_of, made_up, rows_of, run_here, written

DIGEST = "0123456789abcdef" * 4


def test_folders_of_other_campaigns_do_not_mix(tmp_path: Path) -> None:
    run_here(written(tmp_path / "a"), tmp_path / "one", program=STUB)
    with pytest.raises(ConfigurationError, match=r"holds another campaign, which differs in campaign.yaml"):
        run_here(written(tmp_path / "b", seed=4), tmp_path / "one", program=STUB)
    with pytest.raises(ConfigurationError, match="holds shard 1/1"):
        run_here(written(tmp_path / "a"), tmp_path / "one", shard=Shard(1, 2), program=STUB)
    run_here(written(tmp_path / "b", seed=4), tmp_path / "other", program=STUB)
    with pytest.raises(ConfigurationError, match="hold different campaigns"):
        merge(tmp_path / "merged", [tmp_path / "one", tmp_path / "other"])
    frozen, number = freeze(written(tmp_path / "a"))
    row = next(iter(rows_of(tmp_path / "one").values()))
    with open_campaign(tmp_path / "lies", frozen, number, Shard()) as opened:
        opened.add(Done(replace(row, seed=row.seed + 1), Beside(0.0, 0.0, "elsewhere")))
    with pytest.raises(ConfigurationError, match="case 0 of smooth under nmpc has another row than"):
        merge(tmp_path / "merged", [tmp_path / "one", tmp_path / "lies"])
    changed = (tmp_path / "one" / "campaign.yaml").read_text(encoding="utf-8").replace("seed: 3", "seed: 5")
    (tmp_path / "one" / "campaign.yaml").write_text(changed, encoding="utf-8")
    with pytest.raises(ConfigurationError, match="the frozen campaign was changed"):
        CampaignFolder(tmp_path / "one")
    with pytest.raises(ConfigurationError, match="something else than a campaign"):
        run_here(written(tmp_path / "a"), tmp_path / "b", program=STUB)


def test_a_corrupted_line_is_named_and_done_again(tmp_path: Path) -> None:
    file, out = written(tmp_path, cases=6), tmp_path / "out"
    run_here(file, out, program=STUB)
    expected, path = digests_of(out), out / JOURNAL
    lines = path.read_bytes().splitlines(keepends=True)
    lines[1] = lines[1].replace(b'"grasp_error":0.001', b'"grasp_error":0.002')  # valid JSON, wrong value
    lines[2] = lines[2][:20] + b"\r" + lines[2][21:]  # still one line
    lines[3] = lines[3].replace(b'"seed":3', b'"seed":4e400')
    lines[4] = b"\x00" * 30 + b"\n"
    lines[5] = b"[" * 100_000 + b"\n"
    path.write_bytes(b"".join(lines))
    frozen, number = freeze(file)
    with open_campaign(out, frozen, number, Shard()) as opened:
        assert [fault.partition(" is corrupted")[0] for fault in opened.faults] == [
            f"{path}, line {number}" for number in range(2, 7)
        ]
        with pytest.raises(ConfigurationError, match="is written to by another run of the campaign"):
            open_campaign(out, frozen, number, Shard())
    assert len(rows_of(out)) == 1
    assert run_here(file, out, program=STUB).before == 1
    assert digests_of(out) == expected and (out / "broken.jsonl").read_bytes().count(b"\n") == 5


@pytest.mark.parametrize("name", [JOURNAL, "manifest.json", "campaign.yaml"])
def test_a_forged_file_is_never_run(name: str, tmp_path: Path) -> None:
    """Nothing in a folder is run or unpickled: what is no row or no campaign is named, whatever it is."""
    begun(tmp_path / "out")
    out, touch = tmp_path / "out", f"touch {tmp_path / 'owned'}"
    if name == "campaign.yaml":
        text = f'name: !!python/object/apply:os.system ["{touch}"]\n'
        (out / name).write_text(text, encoding="utf-8")
        with pytest.raises(ConfigurationError, match=name):
            CampaignFolder(out)
        digest = Frozen(
            {name: text, **{"scenarios/smooth.yaml": (out / "scenarios/smooth.yaml").read_text()}}
        ).digest
        manifest = json.loads((out / "manifest.json").read_text())
        (out / "manifest.json").write_text(json.dumps({**manifest, "digest": digest}))
        with pytest.raises(ConfigurationError, match=name):
            assert CampaignFolder(out).campaign
    else:
        (out / name).write_bytes(f"cos\nsystem\n(S'{touch}'\ntR.\n".encode())
        if name == JOURNAL:
            assert rows_of(out) == {}
        else:
            with pytest.raises(ConfigurationError, match="cannot be read"):
                CampaignFolder(out)
    assert not (tmp_path / "owned").exists()
    sources = (Path(__file__).parents[2] / "sms_handover" / "campaign").rglob("*.py")
    text = "\n".join(path.read_text(encoding="utf-8") for path in sources)
    assert not [
        word for word in ("import pickle", "loads(pickle", "allow_pickle=True", "eval(") if word in text
    ]


def test_a_full_disk_is_a_clear_error_and_the_same_command_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, out, writes, write = written(tmp_path, cases=6), tmp_path / "out", list[int](), os.write

    def full(descriptor: int, data: bytes) -> int:
        writes.append(len(data))
        if len(writes) == 4:
            write(descriptor, data[:40])  # what there was still room for
            raise OSError(ENOSPC, os.strerror(ENOSPC))
        return write(descriptor, data)

    with monkeypatch.context() as patched:
        patched.setattr("sms_handover.campaign.record.journal.os.write", full)
        with pytest.raises(SmsHandoverError, match="No space left on device; make room, then the same"):
            run_here(file, out, program=STUB)
    assert len(rows_of(out)) == (out / JOURNAL).read_bytes().count(b"\n") == 3
    assert (out / JOURNAL).read_bytes().endswith(b"}\n"), "no part of a line is left behind"
    run_here(file, out, program=STUB)
    run_here(file, tmp_path / "good", program=STUB)
    assert digests_of(out) == digests_of(tmp_path / "good")


def test_rows_that_come_together_wait_for_the_disk_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, out, synced = written(tmp_path), tmp_path / "out", list[int]()
    run_here(file, out, program=STUB)
    entries = list(CampaignFolder(out).entries())
    writer = JournalWriter(tmp_path / "journal.jsonl", CampaignFolder(out).manifest.digest)
    monkeypatch.setattr("sms_handover.campaign.record.journal.os.fsync", synced.append)
    writer.add(*entries)
    writer.close()
    assert len(synced) == 1 and (tmp_path / "journal.jsonl").read_bytes() == (out / JOURNAL).read_bytes()


def test_a_beginning_that_was_ended_goes_on(tmp_path: Path) -> None:
    """Wherever it was killed; anything else in the folder is of somebody else."""
    frozen = begun(tmp_path / "good", ())
    campaign, scenario = (frozen.files[name] for name in ("campaign.yaml", "scenarios/smooth.yaml"))
    left: list[dict[str, str]] = [
        {},
        {JOURNAL: ""},
        {JOURNAL: "", ".campaign.yaml": campaign[:9]},
        {JOURNAL: "", "campaign.yaml": campaign, "scenarios/.smooth.yaml": ""},
        {JOURNAL: "", "campaign.yaml": campaign, "scenarios/smooth.yaml": scenario, ".manifest.json": "{"},
    ]
    foreign = [{"notes.txt": ""}, {"campaign.yaml": campaign[:9]}, {JOURNAL: "{}\n"}, {"scenarios/a": ""}]
    for number, files in enumerate([*left, *foreign]):
        path = tmp_path / str(number)
        path.mkdir()
        for name, text in files.items():
            (path / name).parent.mkdir(exist_ok=True)
            (path / name).write_text(text, encoding="utf-8")
        if files in foreign:
            with pytest.raises(ConfigurationError, match="holds something else than a campaign"):
                begun(path)
        else:
            begun(path)
            assert CampaignFolder(path).frozen == frozen and len(rows_of(path)) == 6
            assert not [file for file in path.rglob("*") if file.name.startswith(".")]


def test_nothing_is_changed_while_another_run_writes(tmp_path: Path) -> None:
    frozen, out = begun(tmp_path / "out", (0,)), tmp_path / "out"
    with open_campaign(out, frozen, 6, WHOLE):
        before = (out / "manifest.json").read_bytes()
        with pytest.raises(ConfigurationError, match="is written to by another run of the campaign"):
            open_campaign(out, frozen, 12, WHOLE)
        assert (out / "manifest.json").read_bytes() == before
    with open_campaign(out, frozen, 12, WHOLE) as opened:
        assert opened.cases == CampaignFolder(out).cases == 12
    unlocked = os.open(out / JOURNAL, os.O_RDWR)  # of a run that waited while the journal was mended
    (out / JOURNAL).rename(out / "mended")
    (out / JOURNAL).touch()
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("sms_handover.campaign.record.journal.os.open", lambda *_: unlocked)
        with pytest.raises(ConfigurationError, match="is written to by another run of the campaign"):
            JournalWriter(out / JOURNAL, frozen.digest)


@pytest.mark.parametrize(
    "name",
    [
        *("campaign.yaml", "smooth.yaml", "manifest.json", "2_smooth_nmpc.npz"),
        *("broken.jsonl", "cases.parquet", "index.html"),
    ],
)
def test_a_disk_that_is_full_at_any_file(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is named, what was there is whole, and the same command goes on."""
    frozen, number = freeze(written(tmp_path, cases=3))
    out, sync = tmp_path / "out", os.fsync
    pages = "sms_handover.campaign.record.outputs.campaign_page"
    monkeypatch.setattr(pages, lambda folder: "a page")

    def carry_out() -> None:
        with open_campaign(out, frozen, number, WHOLE) as opened:
            there = rows_of(out)
            opened.add(
                *(made_up(case, b"%d" % case) for case in range(3) if (case, "smooth", "nmpc") not in there)
            )
            list(write_outputs(out, None))

    def full(descriptor: int) -> None:
        if os.readlink(f"/proc/self/fd/{descriptor}").endswith(f".{name}"):
            raise OSError(ENOSPC, os.strerror(ENOSPC))
        sync(descriptor)

    before = {}
    if name in ("broken.jsonl", "cases.parquet", "index.html"):
        carry_out()
        if name == "broken.jsonl":
            (out / JOURNAL).write_bytes((out / JOURNAL).read_bytes().replace(b'"y":', b'"z":', 1))
        before = {file: file.read_bytes() for file in out.rglob("*") if file.is_file()}
        before.pop(out / "manifest.json")
        monkeypatch.setattr(pages, lambda folder: "another page")
    with monkeypatch.context() as patched, pytest.raises(SmsHandoverError) as error:
        patched.setattr("sms_handover.campaign.record.durable_file.os.fsync", full)
        carry_out()
    told = f"/{name} cannot be written: No space left on device; make room, then the same command goes on"
    assert str(error.value).endswith(told)
    assert {file: file.read_bytes() for file in before} == before
    carry_out()
    assert rows_of(out) == {done.row.task: done.row for done in map(made_up, range(3))}
    assert [(out / "trajectories" / f"{case}_smooth_nmpc.npz").read_bytes() for case in range(3)] == [
        b"0",
        b"1",
        b"2",
    ]
    assert (out / "index.html").read_text() == ("another page" if before else "a page")
    assert not [file for file in out.rglob("*") if file.name.startswith(".")]


def test_names_are_on_disk_before_what_counts_on_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file is synced under its temporary name, then renamed, then its folder synced; then come rows."""
    events, sync, rename, out = list[tuple[str, Path]](), os.fsync, Path.replace, tmp_path / "runs" / "out"

    def syncing(descriptor: int) -> None:
        events.append(("sync", Path(os.readlink(f"/proc/self/fd/{descriptor}"))))
        sync(descriptor)

    def renaming(path: Path, target: Path) -> Path:
        events.append(("rename", target))
        return rename(path, target)

    monkeypatch.setattr("sms_handover.campaign.record.durable_file.os.fsync", syncing)
    monkeypatch.setattr(Path, "replace", renaming)
    JournalWriter(tmp_path / "alone.jsonl", DIGEST).close()
    assert events == [("sync", tmp_path)]
    events.clear()
    frozen, number = freeze(written(tmp_path / "file", cases=6))
    with open_campaign(out, frozen, number, WHOLE) as opened:
        opened.add(made_up(0), made_up(1))
    (out / JOURNAL).write_bytes((out / JOURNAL).read_bytes().replace(b'"y":', b'"z":', 1))
    with open_campaign(out, frozen, 6, WHOLE) as opened:
        opened.add(made_up(0, b"trajectory"))
    renamed = [target.name for kind, target in events if kind == "rename"]
    first = ["campaign.yaml", "manifest.json", "smooth.yaml"]
    assert sorted(renamed[:3]) == first
    assert renamed[3:] == ["broken.jsonl", JOURNAL, "manifest.json", "0_smooth_nmpc.npz"]
    assert events[:2] == [("sync", tmp_path), ("sync", tmp_path / "runs")]
    assert events[events.index(("rename", out / JOURNAL)) + 1] == ("sync", out)
    for place, (kind, target) in enumerate(events):
        if kind == "rename":
            later = events[place:]
            rows = [at for at, event in enumerate(later) if event == ("sync", out / JOURNAL)]
            assert events[place - 1] == ("sync", target.with_name(f".{target.name}"))
            assert ("sync", target.parent) in later[: rows[0] if rows else None]


def test_any_byte_of_a_journal_may_be_corrupted(tmp_path: Path) -> None:
    """A row is as it was, or its line is told and left out; the rest is there."""
    source, path, dice = tmp_path / "source.jsonl", tmp_path / JOURNAL, random.Random(7)
    rows = [made_up(case).row for case in range(6)]
    writer = JournalWriter(source, DIGEST)
    writer.add(*(Entry(row, Beside(0.0, 0.1, "nowhere")) for row in rows))
    writer.close()
    good = source.read_bytes()
    for number in range(400):
        place, data = dice.randrange(len(good)), bytearray(good)
        data[place] = dice.choice([byte for byte in range(256) if byte != good[place]])
        line = good[:place].count(b"\n")
        path.write_bytes(data)
        faults = JournalFaults()
        found = [entry.row for entry in entries_of(path, DIGEST, faults)]
        missing = [row.task.case for row in rows if row not in found]
        assert found == [row for row in rows if row.task.case not in missing]
        assert set(missing) <= ({line, line + 1} if good[place] == ord("\n") else {line})
        assert bool(missing) == bool(faults.broken or faults.torn), (place, bytes(data))
        assert all(at - 1 in (line, line + 1) for at in faults.broken)
        if number % 50 == 0:
            JournalWriter(path, DIGEST).close()
            mended = JournalFaults()
            assert [
                entry.row for entry in entries_of(path, DIGEST, mended)
            ] == found and mended == JournalFaults()


def test_whoever_only_reads_mends_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    begun(tmp_path / "out")
    path = tmp_path / "out" / JOURNAL
    path.write_bytes(path.read_bytes().replace(b'"y":', b'"z":', 1) + b'{"row"')
    assert main(["campaign", "status", str(tmp_path / "out")]) == 3
    assert capsys.readouterr().err.splitlines() == [
        f"{path}, line 1 is corrupted and left out: 'campaign run' runs its case again",
        f"{path}: the last line has no end, as while it is written, and is left out",
    ]
    assert path.read_bytes().endswith(b'{"row"')


def test_merge_names_what_is_corrupted_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Rows wait for the disk together; what was ended is no campaign folder, the same command goes on."""
    parts, out = [tmp_path / "1", tmp_path / "2"], tmp_path / "merged"
    frozen = begun(parts[0], (0, 2, 4), Shard(1, 2))
    begun(parts[1], (1, 3, 5), Shard(2, 2))
    journal = parts[1] / JOURNAL
    journal.write_bytes(journal.read_bytes().replace(b'"y":', b'"z":', 1))
    monkeypatch.setattr("sms_handover.campaign.record.campaign_folder._TOGETHER", 2)
    added: list[int] = []
    add: Callable[..., None] = JournalWriter.add

    def full(writer: JournalWriter, *entries: Entry) -> None:
        if len(added) == 2:
            added.clear()
            raise SmsHandoverError("full")
        added.append(len(entries))
        add(writer, *entries)

    monkeypatch.setattr(JournalWriter, "add", full)
    with pytest.raises(SmsHandoverError, match="full"):
        merge(out, parts)
    with pytest.raises(ConfigurationError, match="is no campaign folder"):
        CampaignFolder(out)
    with pytest.raises(ConfigurationError, match="holds something else than a campaign"):
        open_campaign(out, frozen, 6, WHOLE)
    with pytest.raises(ConfigurationError, match="holds rows of other parts"):
        merge(out, parts[1:])
    monkeypatch.setattr("sms_handover.cli.campaign.merge.tell_outputs", lambda path: True)
    assert main(["campaign", "merge", *map(str, parts), "-o", str(out)]) == 3
    said = capsys.readouterr()
    assert said.err == f"{journal}, line 1 is corrupted and left out: 'campaign run' runs its case again\n"
    assert said.out == "5 of 6 rows\n" and added == [1]
    assert [task.case for task in rows_of(out)] == [0, 2, 3, 4, 5]
