"""Bag file: one MCAP file while it is being written."""

import os
from collections.abc import Mapping
from errno import ENOENT
from io import BufferedWriter

from mcap.writer import CompressionType, Writer

from sms_handover.bag.mcap.scan import Source

LIBRARY = "sms_handover"  # what the header of our bags names

_PROFILE = "ros2"


class BagFile:
    """An MCAP file open for writing; errors of the disk are OSError."""

    def __init__(self, folder: int, name: str, chunk_size: int) -> None:
        """Create a file in a folder given by its descriptor, which survives a move of the folder."""
        self.name = name
        self.start_ns: int | None = None
        self.end_ns = 0
        self.message_count = 0
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        self._stream: BufferedWriter = os.fdopen(os.open(name, flags, 0o666, dir_fd=folder), "wb")
        self._mcap = Writer(self._stream, chunk_size=chunk_size, compression=CompressionType.ZSTD)
        self._schemas: dict[tuple[str, str, bytes], int] = {}

    def start(self) -> None:
        """Write the head of the file."""
        self._mcap.start(profile=_PROFILE, library=LIBRARY)

    @property
    def size(self) -> int:
        """Return the number of bytes written."""
        return self._stream.tell()

    @property
    def duration_ns(self) -> int:
        """Return the log time from the first message to the last."""
        return 0 if self.start_ns is None else self.end_ns - self.start_ns

    def open_channel(self, source: Source) -> int:
        """Open a channel, and its schema unless it is open; return the number of the channel."""
        schema = source.schema
        same = (schema.name, schema.encoding, schema.data)
        if same not in self._schemas:
            self._schemas[same] = self._mcap.register_schema(*same) if schema.name else 0
        return self._mcap.register_channel(
            source.topic, source.encoding, self._schemas[same], dict(source.metadata)
        )

    def write(self, channel: int, log_time_ns: int, data: bytes, publish_time_ns: int, sequence: int) -> None:
        """Append one message."""
        self._mcap.add_message(channel, log_time_ns, data, publish_time_ns, sequence)
        self.message_count += 1
        if self.start_ns is None or log_time_ns < self.start_ns:
            self.start_ns = log_time_ns
        if log_time_ns > self.end_ns:
            self.end_ns = log_time_ns

    def attach(self, name: str, media_type: str, content: bytes, log_time_ns: int, created_ns: int) -> None:
        """Store a whole file."""
        self._mcap.add_attachment(created_ns, log_time_ns, name, media_type, content)

    def record(self, name: str, values: Mapping[str, str]) -> None:
        """Store a metadata record."""
        self._mcap.add_metadata(name, dict(values))

    def flush(self) -> None:
        """Hand everything to the operating system; raises OSError also if the file was deleted."""
        self._mcap.flush()  # type: ignore[no-untyped-call]
        if os.fstat(self._stream.fileno()).st_nlink == 0:
            raise FileNotFoundError(ENOENT, "it was deleted while it was being written")

    def finish(self) -> None:
        """Write the end of the file, sync and close it."""
        with self._stream as stream:
            self._mcap.finish()  # type: ignore[no-untyped-call]
            stream.flush()
            os.fsync(stream.fileno())

    def close(self) -> None:
        """Close the file without writing its end."""
        self._stream.close()
