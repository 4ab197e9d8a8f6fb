"""The page of the messages and services of sms_handover_interfaces, from their definitions."""

from pathlib import Path

from docs.tables import WRITTEN_BY, table

_INTERFACES = Path(__file__).resolve().parent.parent / "interfaces"


def messages_page() -> str:
    """Return the page."""
    parts = [
        "# Our messages and services",
        WRITTEN_BY,
        """\
The package `sms_handover_interfaces` has the types for which there is no standard one. Everything else uses
`sensor_msgs`, `nav_msgs`, `geometry_msgs`, `std_msgs`, `diagnostic_msgs`, `visualization_msgs` and
`rosgraph_msgs`. [topics.md](topics.md) lists the type of each topic; frames, signs and stamps are in
[conventions.md](conventions.md). A time stamp is simulation time unless its comment says otherwise.""",
    ]
    for folder, title in (("msg", "Messages"), ("srv", "Services")):
        files = sorted((_INTERFACES / folder).glob(f"*.{folder}"))
        rows = [(f"[`{file.stem}`](#{file.stem.lower()})", _first_sentence(file)) for file in files]
        parts += [f"## {title}", table(("Type", "Meaning"), rows)]
        for file in files:
            text = file.read_text(encoding="utf-8").rstrip()
            parts += [
                f"### {file.stem}",
                f"`sms_handover_interfaces/{folder}/{file.stem}`",
                f"```text\n{text}\n```",
            ]
    return "\n\n".join(parts) + "\n"


def _first_sentence(file: Path) -> str:
    """Return what the comment at the head of a definition says first."""
    lines = file.read_text(encoding="utf-8").splitlines()
    end = next(i for i, line in enumerate(lines) if not line.startswith("#"))
    comment = " ".join(line.removeprefix("#").strip() for line in lines[:end])
    return comment.partition(". ")[0].rstrip(".") + "."
