"""Compression in bags: of chunks, of single messages and of whole files."""

import shutil
from io import BytesIO
from pathlib import Path
from typing import Any

import lz4.frame
import zstandard

COMPRESSED_FILE = (".zstd", ".zst")  # suffixes
COMPRESSION_ERRORS = (zstandard.ZstdError, RuntimeError, EOFError, ValueError, MemoryError, OverflowError)

_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"  # CDR begins with a zero byte
_LARGEST_MESSAGE = 2**31  # [byte]
_BLOCK = 2**20  # [byte] read at once: a stated size may be wrong by any amount


def inflate(compression: str, stored: bytes | memoryview, size: int) -> bytes:
    """Return the content of a chunk, of any number of frames; raises one of COMPRESSION_ERRORS."""
    if compression == "zstd":
        with zstandard.ZstdDecompressor().stream_reader(stored, read_across_frames=True) as stream:
            return _read(stream, size + 1)
    if compression == "lz4":
        with lz4.frame.open(BytesIO(stored)) as stream:
            return _read(stream, size + 1)
    if compression:
        raise ValueError(f"unknown compression {compression!r}")
    return bytes(stored)


def inflate_message(encoding: str, data: bytes) -> bytes:
    """Return the message in compressed bytes (``compression_mode: MESSAGE``), any others as they are."""
    if encoding != "cdr" or data[:4] != _ZSTD_MAGIC:
        return data
    try:
        return inflate("zstd", data, _LARGEST_MESSAGE)
    except COMPRESSION_ERRORS:
        return data


def inflate_file(file: Path, folder: Path) -> Path:
    """Decompress a file (``compression_mode: FILE``) into a folder; raises one of COMPRESSION_ERRORS."""
    target = folder / file.stem
    decompressor = zstandard.ZstdDecompressor()
    with (
        file.open("rb") as source,
        target.open("wb") as sink,
        decompressor.stream_reader(source, read_across_frames=True) as stream,
    ):
        shutil.copyfileobj(stream, sink)
    return target


def _read(stream: Any, size: int) -> bytes:
    """Return up to ``size`` bytes of a decompressing stream."""
    content = bytearray()
    while part := stream.read(min(size - len(content), _BLOCK)):
        content += part
    return bytes(content)
