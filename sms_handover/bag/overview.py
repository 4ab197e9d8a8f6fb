"""Overview of a bag as plain values, for people and for JSON."""

import zlib
from dataclasses import asdict

from sms_handover.bag.info import BagInfo
from sms_handover.errors import BagError
from sms_handover.graph.topics import CONTROLLER, PLANT


def overview(info: BagInfo) -> dict[str, object]:
    """Return the content of a bag; ``run`` and ``ledger`` are None unless this package recorded it."""
    return {
        "bag": str(info.path),
        "files": [file.name for file in info.files],
        "size": info.size,
        "profile": info.profile,
        "library": info.library,
        "start_ns": info.start_ns,
        "end_ns": info.end_ns,
        "duration_ns": info.duration_ns,
        "message_count": info.message_count,
        "topics": [
            {"name": topic.name, "type": topic.type, "message_count": topic.message_count}
            for topic in info.channels
        ],
        "missing": list(info.missing),
        "notes": list(info.notes),
        "run": _run(info),
        "provenance": dict(info.provenance),
        "attachments": {name: len(content) for name, content in info.attachments.items()},
        "records": list(info.records),
        "ledger": None if info.ledger is None else [asdict(topic) for topic in info.ledger.topics],
        "complete": None if info.ledger is None else info.ledger.complete,
    }


def _run(info: BagInfo) -> dict[str, object] | None:
    """Return how the run was made, None if the bag holds none."""
    try:
        parameters = info.parameters
    except BagError:
        return None
    if not parameters:
        return None
    plant, controller = parameters.get(PLANT, {}), parameters.get(CONTROLLER, {})
    schedule = None if info.schedule_text is None else f"CRC-32 {zlib.crc32(info.schedule_text.encode()):08x}"
    names = ("mode", "tick", "reference_period", "duration", "integrator")
    return {
        "controller": controller.get("law"),
        **{name: plant[name] for name in names if name in plant},
        "schedule": schedule,
        "seed": info.provenance.get("seed"),
    }
