"""Generate the reference pages (parameters, topics, commands, messages) and the schemas of YAML files."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from docs.commands import commands_page
from docs.messages import messages_page
from docs.schemas import schemas
from docs.tables import WRITTEN_BY, table
from sms_handover.graph.services import SERVICES
from sms_handover.graph.topics import CONTROLLER, NODES, RECORDER, SENSOR_TYPES, graph_topics
from sms_handover.ros.reference.interfaces import (
    ANY_ARM,
    COMMON_GROUP,
    OWN_GROUPS,
    ParameterGroup,
    parameter_rows,
    publishers_of,
    qos_text,
    subscribers_of,
)
from sms_handover.ros.reference.topic_descriptions import contents_of

DOCS = Path(__file__).resolve().parent
SCHEMAS = DOCS.parent / "config" / "schemas"


def parameters_page() -> str:
    """Return the page of all parameters."""
    parts = [
        "# Parameters",
        WRITTEN_BY,
        """\
Every node reads its defaults from the files in [`config/`](../config), ROS 2 parameter files with the
reason for each number. `--params-file FILE` overrides them, then `-p NAME:=VALUE` of the node, or
`-p NODE.NAME:=VALUE` of `sms-handover run`. Parameters are set at the start of a node only: they are
read-only, checked one by one and then together, and a wrong or unknown one ends the node with one line and
exit code 2.
`ros2 param describe NODE NAME` prints the same for a running node.

Empty text is `''`; a path is relative to the folder in which the node starts.""",
        *_group("Every node of the graph", COMMON_GROUP),
    ]
    for node, group in OWN_GROUPS.items():
        parts += _group(f"`{node}`" + ("" if node in NODES else " (outside the graph)"), group)
    return "\n\n".join(parts) + "\n"


def topics_page() -> str:
    """Return the page of all topics and services."""
    topics = [
        (
            f"`{topic.name}`",
            f"`{topic.type}`",
            topic.rate.value,
            qos_text(topic),
            _nodes(publishers_of(topic)),
            _nodes(node for node in subscribers_of(topic) if node != RECORDER),
            contents_of(topic),
        )
        for topic in graph_topics([ANY_ARM], clearance=True, sensors=SENSOR_TYPES)
    ]
    services = [
        (f"`{s.relative_name}`", f"`{s.type}`", f"`{s.server}`", _nodes(s.clients), s.does) for s in SERVICES
    ]
    parts = [
        "# Topics and services",
        WRITTEN_BY,
        f"""\
Names without a leading `/` are relative: a namespace precedes them. `{ANY_ARM}` stands for the name of each
arm of the robot, as shipped `arm_a` and `arm_b`. The recorder subscribes to every topic. Frames, signs and
stamps are in [conventions.md](conventions.md), our own types in [messages.md](messages.md).

Your subscription may request less than is offered, such as best effort; a reliable one that keeps up loses
nothing. A reliable subscriber that is too slow blocks the loop: for the state at 50 Hz, use
the sampled topics.""",
        "## Topics",
        table(("Topic", "Type", "Rate", "Quality of service", "From", "Needed by", "Content"), topics),
        """\
Of `tf` the plant publishes links and deputy, the trajectory its targets. It and `tf_static` may have other
publishers too; all of it is recorded, and a reader that hangs loses messages but holds nobody up. Of `/clock`
and `/diagnostics` what the nodes of this graph publish is recorded.""",
        "## Services",
        table(("Service", "Type", "Offered by", "Called by", "Effect"), services),
    ]
    return "\n\n".join(parts) + "\n"


def pages() -> dict[Path, str]:
    """Return the text of every page, and of every schema, that is written here."""
    return {
        DOCS / "parameters.md": parameters_page(),
        DOCS / "topics.md": topics_page(),
        DOCS / "commands.md": commands_page(),
        DOCS / "messages.md": messages_page(),
        **{SCHEMAS / name: text for name, text in schemas().items()},
    }


def _group(title: str, group: ParameterGroup) -> Iterator[str]:
    """Yield the section of a group."""
    rows = [
        (f"`{r.name}`", r.type, f"`{r.default}`", r.unit, r.allowed, r.description)
        for r in parameter_rows(group)
    ]
    yield f"## {title}"
    yield f"Defaults: [`config/{group.file}`](../config/{group.file})."
    yield table(("Parameter", "Type", "Default", "Unit", "Allowed", "Meaning"), rows)
    if group is OWN_GROUPS[CONTROLLER]:
        yield "The schedule may change the gains per phase."


def _nodes(names: Iterable[str]) -> str:
    """Return the names of nodes."""
    return ", ".join(f"`{name}`" for name in names)


def main() -> None:
    """Write the pages."""
    SCHEMAS.mkdir(exist_ok=True)
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
