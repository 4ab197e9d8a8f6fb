"""The written pages hold what a reader looks for; test/test_package.py holds them to be up to date."""

from docs.reference import DOCS, pages
from sms_handover.graph.topics import SENSOR_TYPES, graph_topics
from sms_handover.ros.reference.interfaces import COMMON_GROUP, OWN_GROUPS, parameter_rows

PAGES = pages()


def test_every_parameter_and_topic_has_a_row() -> None:
    parameters, topics = PAGES[DOCS / "parameters.md"], PAGES[DOCS / "topics.md"]
    for group in (COMMON_GROUP, *OWN_GROUPS.values()):
        for row in parameter_rows(group):
            assert f"| `{row.name}` | {row.type} | `{row.default}` | {row.unit} |" in parameters
    for topic in graph_topics(["ARM"], clearance=True, sensors=SENSOR_TYPES):
        assert f"| `{topic.name}` | `{topic.type}` | {topic.rate.value} |" in topics


def test_tables_are_rectangular() -> None:
    for text in PAGES.values():
        width = 0
        for line in text.splitlines():
            columns = line.replace("\\|", "").count("|") if line.startswith("|") else 0
            assert not (width and columns) or columns == width, line
            width = columns
