"""Whether a recorded type is the one that has the same name here."""

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from sms_handover.bag.info import TopicInfo
from sms_handover.errors import BagError
from sms_handover.messages.message_types import MessageTypes


def same_definition(topic: TopicInfo, types: MessageTypes) -> bool:
    """Whether the messages of a topic mean here what they meant when they were recorded.

    The type hash of the bag is compared, or where it has none that of its schema; what cannot be
    compared is taken to be the same.
    """
    recorded = topic.type_hash or _hash_of(topic)
    try:
        return not recorded or recorded == types.schema(topic.type).type_hash
    except BagError:
        return True


def _hash_of(topic: TopicInfo) -> str:
    """Return the type hash of the schema text in a bag, '' if it cannot be told."""
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(get_types_from_msg(topic.schema_text, topic.type))
        return str(store.hash_rihs01(topic.type))
    except (TypesysError, SerdeError, KeyError):
        return ""
