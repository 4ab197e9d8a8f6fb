"""Node parameters on a command line, ``-p NODE:NAME:=VALUE``, also where the node is in a namespace.

rcl takes NODE for the whole name of a node, so that in a namespace such a rule reaches none, and it knows no
pattern there. In a parameter file it does.
"""

import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import pairwise

_FLAGS = ("-p", "--param")
_RULE = re.compile(r"(\w+):([^:=]+):=(.*)", re.DOTALL)
_NAMESPACE = re.compile(r"(\w+:)?__ns:=")


@contextmanager
def in_any_namespace(arguments: Sequence[str]) -> Iterator[list[str]]:
    """Yield the arguments with such rules in files that name the node in any namespace, if they set one.

    The files are there until the context ends, long enough for ROS to start.
    """
    words = list(arguments)
    with ExitStack() as stack:
        if any(map(_NAMESPACE.match, words)):
            for place, (flag, rule) in enumerate(pairwise(arguments)):
                found = _RULE.fullmatch(rule) if flag in _FLAGS else None
                if found is not None:
                    node, name, value = found.groups()
                    file = stack.enter_context(tempfile.NamedTemporaryFile("w", suffix=".yaml"))
                    file.write(f"/**/{node}:\n  ros__parameters:\n    {name}: {value}\n")
                    file.flush()
                    words[place : place + 2] = ["--params-file", file.name]
        yield words
