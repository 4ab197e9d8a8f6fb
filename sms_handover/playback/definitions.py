"""Message definitions: whether a recorded type is the installed one of the same name."""

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from sms_handover.bag.info import TopicInfo
from sms_handover.errors import BagError
from sms_handover.messages.message_types import MessageTypes


def same_definition(topic: TopicInfo, types: MessageTypes) -> bool:
    """Whether a topic was recorded with the installed definition of its type.

    Compares the type hash of the bag, or else that of its schema; what cannot be compared counts as equal.
    """
    recorded = topic.type_hash or _hash_of(topic)
    try:
        return not recorded or recorded == types.schema(topic.type).type_hash
    except BagError:
        return True


def _hash_of(topic: TopicInfo) -> str:
    """Return the type hash of a recorded schema, '' if it cannot be computed."""
    if not topic.schema_text.strip():
        return ""
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(get_types_from_msg(topic.schema_text, topic.type))
        return str(store.hash_rihs01(topic.type))
    except (TypesysError, SerdeError, KeyError):
        return ""
