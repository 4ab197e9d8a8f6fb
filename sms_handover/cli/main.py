"""The main program of the command line ``sms-handover``."""

import os
import sys
from argparse import REMAINDER, ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Sequence
from importlib import import_module

from sms_handover import __version__
from sms_handover.cli.exit_codes import EXIT_FAILED, EXIT_INTERRUPTED, EXIT_USAGE
from sms_handover.errors import ConfigurationError, SmsHandoverError
from sms_handover.ros.process.environment import (
    draw_to_files,
    drop_current_folder,
    prepare_environment,
    require_utf8,
)
from sms_handover.ros.process.shared_memory_check import avoid_full_shared_memory, require_shared_memory
from sms_handover.terminal.streams import let_go_of_failed_output, make_streams_safe

_COMMANDS = {
    "run": "run the handover as a graph of ROS 2 nodes and record it",
    "simulate": "run it in one process, without ROS",
    "compare": "print recorded runs side by side, with the paper's claims",
    "figures": "draw the paper's figures from recorded runs",
    "report": "write an HTML page about recorded runs: figures, plots, claims, provenance, 3D",
    "view": "show recorded runs, or a running graph, in 3D in a browser",
    "bag": "inspect, check, recover or export a bag",
    "reproduce": "run a bag's scenario again in one process and compare bit by bit",
    "play": "publish the messages of any MCAP bag, with keys to control it",
    "record": "record topics of any graph to an MCAP bag",
}
_WITH_ROS = ("run", "play", "record")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return the exit code. Errors of ours are one line on standard error.

    Only the module of that command is imported, so that commands without ROS need no ROS.
    """
    make_streams_safe()
    listed = "\n".join(f"  {name:<10} {text}" for name, text in _COMMANDS.items())
    parser = ArgumentParser(
        prog="sms-handover",
        description="A free-floating spacecraft with two arms hands a CubeSat from one arm to the other.",
        epilog=f"commands:\n{listed}\n\nSee 'sms-handover COMMAND --help'.",
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"sms-handover {__version__}")
    parser.add_argument("command", choices=tuple(_COMMANDS), metavar="COMMAND", help="see below")
    parser.add_argument("arguments", nargs=REMAINDER, metavar="...", help="options of the command")
    chosen = parser.parse_args(arguments)
    try:
        return _run(chosen.command, chosen.arguments)
    except BrokenPipeError:  # the reader has closed the pipe, as head(1) does
        return EXIT_FAILED
    except UnicodeEncodeError as error:
        reason = f"{error.object!a} is not UTF-8: rename it, or give a symbolic link to it"
        print(f"sms-handover {chosen.command}: error: {reason}", file=sys.stderr)
        return EXIT_USAGE
    except (SmsHandoverError, OSError, MemoryError) as error:
        print(f"sms-handover {chosen.command}: error: {error or 'out of memory'}", file=sys.stderr)
        return EXIT_USAGE if isinstance(error, ConfigurationError) else EXIT_FAILED
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    finally:
        let_go_of_failed_output()


def _run(name: str, arguments: Sequence[str]) -> int:
    """Import the module of one command and run it; return the exit code."""
    drop_current_folder(sys.path)
    draw_to_files()
    if name in _WITH_ROS or (name == "view" and "--live" in arguments):
        _prepare_ros(name, arguments)
    module = import_module(f"sms_handover.cli.{name}")
    parser = ArgumentParser(prog=f"sms-handover {name}")
    module.add_parser(parser)
    code = int(module.command(parser.parse_args(arguments)))
    sys.stdout.flush()
    return code


def _prepare_ros(name: str, arguments: Sequence[str]) -> None:
    """Check what ROS needs before it is imported, and report what was changed for it."""
    private = name == "run"
    require_utf8([*arguments, os.getcwd()] if private else arguments)
    require_shared_memory()
    for change in (*prepare_environment(private=private), avoid_full_shared_memory()):
        if change:
            print(f"sms-handover {name}: {change}", file=sys.stderr)
    try:
        import_module("rclpy")
    except ImportError as error:
        raise ConfigurationError(
            f"this needs ROS, which cannot be imported: {' '.join(str(error).split())}; install the extra "
            "'ros' (docs/install.md), and unset PYTHONPATH and LD_LIBRARY_PATH if another ROS is sourced"
        ) from error


def run_main() -> int:
    """Run ``sms-handover run``, for ``ros2 run sms_handover handover``."""
    return main(["run", *sys.argv[1:]])


if __name__ == "__main__":
    raise SystemExit(main())
