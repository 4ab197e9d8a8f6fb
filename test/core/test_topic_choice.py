import pytest

from sms_handover.bag.topic_choice import TopicChoice
from sms_handover.errors import ConfigurationError

NAMES = ("/joint_states", "/joint_command", "/arm_a/tool_pose", "/arm_b/tool_pose", "/clock")


def chosen(choice: TopicChoice) -> list[str]:
    return [name for name in NAMES if choice.wants(name)]


def test_all_topics_are_wanted_by_default() -> None:
    assert chosen(TopicChoice()) == list(NAMES)


def test_names_are_full_or_from_the_root() -> None:
    assert chosen(TopicChoice(topics=("clock", "/joint_states"))) == ["/joint_states", "/clock"]
    assert chosen(TopicChoice(topics=("joint",))) == []


def test_an_expression_adds_to_the_names_and_may_match_anywhere() -> None:
    choice = TopicChoice(topics=("/clock",), regex="tool_pose$")
    assert chosen(choice) == ["/arm_a/tool_pose", "/arm_b/tool_pose", "/clock"]
    assert chosen(TopicChoice(regex="^/joint")) == ["/joint_states", "/joint_command"]


def test_exclusions_come_on_top() -> None:
    choice = TopicChoice(topics=("/clock",), regex="pose", exclude_topics=("clock",), exclude_regex="arm_b")
    assert chosen(choice) == ["/arm_a/tool_pose"]
    assert chosen(TopicChoice(exclude_regex="arm|joint")) == ["/clock"]


def test_names_that_are_not_there_are_told() -> None:
    assert TopicChoice(topics=("clock", "nix", "/nowhere")).absent(NAMES) == ["/nix", "/nowhere"]
    assert TopicChoice(regex="nothing").absent(NAMES) == []


@pytest.mark.parametrize("field", ["regex", "exclude_regex"])
def test_an_expression_that_is_none_is_refused(field: str) -> None:
    with pytest.raises(ConfigurationError, match=r"regular expression '\(' is not readable"):
        TopicChoice(**{field: "("})  # type: ignore[arg-type]
