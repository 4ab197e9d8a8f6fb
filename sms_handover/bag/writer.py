"""Bag writer: MCAP files and ``metadata.yaml`` in a new folder, in the layout of rosbag2.

``log_time`` of a message is simulation time, the run's own clock for readers and players;
``publish_time`` is wall time, which keeps the delays of the messages visible.
"""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path

from mcap.records import Schema as McapSchema

from sms_handover.bag.bag_file import BagFile
from sms_handover.bag.mcap.scan import Source
from sms_handover.bag.metadata import (
    METADATA_FILE,
    ROSBAG2_KEY,
    ROSBAG2_RECORD,
    FileSpan,
    TopicCount,
    bag_information,
    qos_text,
    to_yaml,
)
from sms_handover.bag.qos import Qos, profiles_of
from sms_handover.bag.split import Split
from sms_handover.errors import BagError
from sms_handover.messages.message_types import MessageTypes

CHUNK_SIZE = 64 * 1024  # [byte] of uncompressed messages held back at most
FLUSH_PERIOD_NS = 20_000_000  # [ns] of log time held back at most


@dataclass
class _Topic:
    """A topic, its channel in the current file, and its number of messages."""

    source: Source
    qos: Sequence[Mapping[str, object]]
    channel: int
    count: int = 0


class BagWriter:
    """An open bag; as a context manager it leaves a complete bag even after an error."""

    def __init__(
        self,
        folder: Path,
        *,
        types: MessageTypes | None = None,
        chunk_size: int = CHUNK_SIZE,
        flush_period_ns: int = FLUSH_PERIOD_NS,
        split: Split | None = None,
    ) -> None:
        """Create ``folder`` and ``<folder>/<name>_0.mcap``; raises BagError if it cannot.

        With a ``split`` the recording continues in ``<name>_1.mcap`` and so on. Each file is complete
        by itself: it repeats all earlier topics, attachments and records.
        """
        self.folder = Path(folder)
        self.types = MessageTypes() if types is None else types
        self._chunk_size = chunk_size
        self._flush_period_ns = flush_period_ns
        self._split = Split() if split is None else split
        self._flushed_ns = 0
        self._topics: dict[str, _Topic] = {}
        self._repeated: list[Callable[[BagFile], None]] = []  # in every later file too
        self._finished: list[FileSpan] = []
        self._closed = False
        self._writable = True
        self._failure: BagError | None = None
        self._handle = _create(self.folder)  # still valid if the folder is moved
        try:
            self._file = BagFile(self._handle, self._next_name, chunk_size)
        except OSError as error:
            os.close(self._handle)
            self.folder.rmdir()
            path = self.folder / self._next_name
            raise BagError(f"cannot create the recording {path}: {error.strerror}") from error
        try:
            with self._reported():
                self._begin_file()
                self._file.flush()
        except BagError:
            self.abandon()
            raise

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        """Close the bag; an error raised in the block takes precedence over one of closing."""
        if error is None:
            self.close()
        else:
            with suppress(BagError):
                self.close()

    @property
    def closed(self) -> bool:
        """Whether the bag has been closed."""
        return self._closed

    @property
    def path(self) -> Path:
        """Return the file that is being written."""
        return self.folder / self._file.name

    @property
    def message_counts(self) -> dict[str, int]:
        """Return the number of messages written so far, by topic."""
        return {name: topic.count for name, topic in self._topics.items()}

    def topic_of(self, key: str) -> str:
        """Return the name of the topic that messages are written to by ``key``."""
        return self._topics[key].source.topic

    def add_topic(self, name: str, type_name: str, qos: Sequence[Qos] = ()) -> None:
        """Open a topic for writing; raises BagError on a second topic of that name or an unknown type."""
        self._require_open()
        if name in self._topics:
            raise BagError(f"topic {name!r} is recorded into {self.folder} already")
        schema = self.types.schema(type_name)
        profiles = [profile.to_rosbag2() for profile in qos]
        metadata = {"offered_qos_profiles": _offered(tuple(qos)), "topic_type_hash": schema.type_hash}
        content = McapSchema(id=0, name=type_name, encoding="ros2msg", data=schema.text.encode())
        self._open(name, Source(name, "cdr", content, metadata), profiles)

    def add_source(self, key: str, source: Source) -> None:
        """Open a topic as it was in another bag; messages are then written to it by ``key``."""
        self._require_open()
        profiles = profiles_of(source.metadata.get("offered_qos_profiles", ""))
        metadata = {**source.metadata, "offered_qos_profiles": qos_text(profiles)}
        self._open(key, replace(source, metadata=metadata), profiles)

    def write(
        self, topic: str, data: bytes, log_time_ns: int, publish_time_ns: int, sequence: int = 0
    ) -> None:
        """Append the CDR bytes of one message; the topic must have been added."""
        entry = self._topics.get(topic)
        if not self._writable or entry is None or log_time_ns < 0 or publish_time_ns < 0:
            raise self._rejection(topic)
        try:
            self._file.write(entry.channel, log_time_ns, data, publish_time_ns, sequence)
        except OSError as error:
            raise self._failed(error) from error
        entry.count += 1
        if log_time_ns - self._flushed_ns >= self._flush_period_ns:
            self.flush()

    def flush(self) -> None:
        """Hand everything written so far to the operating system; call it also while no messages come.

        Raises BagError if writing fails, or if the file has been deleted.
        """
        self._require_open()
        self._flushed_ns = self._file.end_ns
        with self._reported():
            self._file.flush()
            if self._split.due(self._file.duration_ns, self._file.size):
                self._next_file()

    def attach(
        self,
        name: str,
        media_type: str,
        content: bytes,
        log_time_ns: int = 0,
        create_time_ns: int | None = None,
    ) -> None:
        """Store a whole file in the bag, e.g. ``robot.urdf``."""
        self._require_open()
        created_ns = log_time_ns if create_time_ns is None else create_time_ns
        values = (name, media_type, content, log_time_ns, created_ns)
        with self._reported():
            self._file.attach(*values)
        self._repeated.append(lambda file: file.attach(*values))

    def record(self, name: str, values: Mapping[str, str]) -> None:
        """Store a metadata record: a name with keys and texts."""
        self._require_open()
        with self._reported():
            self._file.record(name, values)
        self._repeated.append(partial(BagFile.record, name=name, values=dict(values)))

    def close(self) -> None:
        """Complete the bag and wait until it is on the disk; a second call does nothing.

        A folder that has been moved gets its ``metadata.yaml`` where it is now. After a failed write
        BagError is raised and the file has no end, so that it does not look complete.
        """
        if self._closed:
            return
        self._closed, self._writable = True, False
        if self._failure is not None:
            with suppress(OSError):
                self._file.close()
            os.close(self._handle)
            raise self._failure
        try:
            with self._reported():
                self._end_file()
                _write_synced(self._handle, METADATA_FILE, to_yaml({ROSBAG2_KEY: self._information()}))
                with suppress(OSError):  # not every file system can sync a folder
                    os.fsync(self._handle)
        finally:
            os.close(self._handle)

    def abandon(self) -> None:
        """Delete the bag."""
        if not self._closed:
            self._closed, self._writable = True, False
            with suppress(OSError):
                self._file.close()
            os.close(self._handle)
        for name in (*(file.name for file in self._finished), self._file.name, METADATA_FILE):
            (self.folder / name).unlink(missing_ok=True)
        with suppress(OSError):
            self.folder.rmdir()

    def _open(self, key: str, source: Source, profiles: Sequence[Mapping[str, object]]) -> None:
        self._topics[key] = _Topic(source, tuple(profiles), self._file.open_channel(source))

    @property
    def _next_name(self) -> str:
        return f"{self.folder.name}_{len(self._finished)}.mcap"

    def _begin_file(self) -> None:
        """Write the head of a file; even one that is never closed gives the version of its QoS texts."""
        self._file.start()
        self._describe()

    def _end_file(self) -> None:
        self._file.flush()
        self._describe()
        self._file.finish()

    def _next_file(self) -> None:
        """Complete the current file and open the next, with all that precedes messages."""
        self._end_file()
        self._finished.append(_span(self._file))
        self._file = BagFile(self._handle, self._next_name, self._chunk_size)
        self._begin_file()
        for topic in self._topics.values():
            topic.channel = self._file.open_channel(topic.source)
        for repeat in self._repeated:
            repeat(self._file)

    def _describe(self) -> None:
        """Write the record from which rosbag2 reads the metadata if ``metadata.yaml`` is lost."""
        self._file.record(ROSBAG2_RECORD, {"serialized_metadata": to_yaml(self._information())})

    def _information(self) -> dict[str, object]:
        topics = [
            TopicCount(
                topic.source.topic,
                topic.source.schema.name,
                topic.source.encoding,
                topic.source.metadata.get("topic_type_hash", ""),
                topic.qos,
                topic.count,
            )
            for topic in self._topics.values()
        ]
        return bag_information([*self._finished, _span(self._file)], topics)

    def _require_open(self) -> None:
        if not self._writable:
            raise self._failure or BagError(f"the recording in {self.folder} is closed")

    def _rejection(self, topic: str) -> BagError:
        self._require_open()
        if topic not in self._topics:
            return BagError(f"topic {topic!r} was not added to the recording in {self.folder}")
        return BagError(f"a message on {topic!r} has a negative time")

    @contextmanager
    def _reported(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise self._failed(error) from error

    def _failed(self, error: OSError) -> BagError:
        """Stop writing after an error: what follows would not be a readable file."""
        self._writable = False
        path = self.folder / (error.filename or self._file.name)
        self._failure = BagError(f"cannot write the recording {path}: {error.strerror}")
        return self._failure


def _create(folder: Path) -> int:
    try:
        folder.mkdir()
        return os.open(folder, os.O_RDONLY)
    except FileExistsError:
        raise BagError(
            f"{folder} exists already: a recording never overwrites, choose another output folder"
        ) from None
    except FileNotFoundError:
        raise BagError(f"cannot create {folder}: its parent folder does not exist") from None
    except OSError as error:
        raise BagError(f"cannot create the recording {folder}: {error.strerror}") from error


@cache
def _offered(qos: tuple[Qos, ...]) -> str:
    """Return what a channel says of profiles: YAML takes milliseconds, and most topics have the same."""
    return qos_text([profile.to_rosbag2() for profile in qos])


def _span(file: BagFile) -> FileSpan:
    start_ns = 0 if file.start_ns is None else file.start_ns
    return FileSpan(file.name, start_ns, max(start_ns, file.end_ns), file.message_count)


def _write_synced(folder: int, name: str, text: str) -> None:
    handle = os.open(name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666, dir_fd=folder)
    with os.fdopen(handle, "w", encoding="utf-8") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
