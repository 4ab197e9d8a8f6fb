"""The main program of the command line ``sms-handover``."""

import gc
import os
import sys
from argparse import ArgumentParser
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from importlib import import_module

from sms_handover.cli.exit_codes import EXIT_FAILED, EXIT_INTERRUPTED, EXIT_USAGE
from sms_handover.cli.verbs import PROGRAM, Call, call_of
from sms_handover.errors import ConfigurationError, SmsHandoverError
from sms_handover.launcher.node_server import NodeServer
from sms_handover.ros.process.environment import (
    draw_to_files,
    drop_current_folder,
    prepare_environment,
    require_utf8,
)
from sms_handover.ros.process.shared_memory_check import avoid_full_shared_memory, require_shared_memory
from sms_handover.terminal.streams import let_go_of_failed_output, make_streams_safe

_HELP = {"-h", "--help"}
_WITH_ROS = ("run", "bag play", "bag record")  # import it; others say by their options whether they need it


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb; return the exit code. Errors of ours are one line on standard error.

    Only the module of that verb is imported, so that verbs without ROS need no ROS.
    """
    make_streams_safe()
    said_by = PROGRAM
    try:
        call = call_of(arguments)
        said_by = f"{PROGRAM} {call.verb}"
        if call.notice:
            print(f"{PROGRAM}: {call.notice}", file=sys.stderr)
        return _run(call)
    except BrokenPipeError:  # the reader has closed the pipe, as head(1) does
        return EXIT_FAILED
    except UnicodeEncodeError as error:
        reason = f"{error.object!a} is not UTF-8: rename it, or give a symbolic link to it"
        print(f"{said_by}: error: {reason}", file=sys.stderr)
        return EXIT_USAGE
    except (SmsHandoverError, OSError, MemoryError) as error:
        print(f"{said_by}: error: {str(error) or 'out of memory'}", file=sys.stderr)
        return EXIT_USAGE if isinstance(error, ConfigurationError) else EXIT_FAILED
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    finally:
        let_go_of_failed_output()


def _run(call: Call) -> int:
    """Import the module of one verb and run it; return the exit code."""
    drop_current_folder(sys.path)
    draw_to_files()
    with ExitStack() as stack:
        imports = stack.enter_context(ExitStack())
        if call.module not in sys.modules:
            imports.enter_context(_without_collections())
        server = None
        if call.verb in _WITH_ROS:
            _prepare_ros(call)
            if call.verb == "run" and not _HELP & set(call.arguments):
                server = stack.enter_context(NodeServer())  # it imports at the same time as this process
            _import_ros()
        module = import_module(call.module)
        imports.close()
        parser = ArgumentParser(prog=f"{PROGRAM} {call.verb}")
        module.add_parser(parser)
        parser.set_defaults(node_server=server)
        options = parser.parse_args(call.arguments)
        if hasattr(module, "needs_ros") and module.needs_ros(options):
            _prepare_ros(call)
            _import_ros()
        code = int(module.command(options))
        sys.stdout.flush()
        return code


@contextmanager
def _without_collections() -> Iterator[None]:
    """Import without garbage collections: nearly all stays, and visiting it takes a fifth of the time."""
    gc.disable()
    try:
        yield
        gc.freeze()
    finally:
        gc.enable()


def _prepare_ros(call: Call) -> None:
    """Check what ROS needs before it is imported, and report what was changed for it."""
    private = call.verb in ("run", "campaign rerun")
    require_utf8([*call.arguments, os.getcwd()] if private else call.arguments)
    require_shared_memory()
    for change in (*prepare_environment(private=private), avoid_full_shared_memory()):
        if change:
            print(f"{PROGRAM} {call.verb}: {change}", file=sys.stderr)


def _import_ros() -> None:
    """Import ROS; raises ConfigurationError where it is not installed."""
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
