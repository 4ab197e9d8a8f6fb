"""Keys come one by one, and the terminal is left as it was found, whatever happens."""

import os
import signal

import pytest

from sms_handover.terminal.keyboard import Keyboard

from .terminal import Terminal

PROGRAM = """
import sys, time
from sms_handover.terminal.keyboard import Keyboard
def stop(number, frame):
    sys.exit(7)
import signal
signal.signal(signal.SIGTERM, stop)
signal.signal(signal.SIGINT, signal.default_int_handler)  # whatever the tests were started by ignores
with Keyboard() as keyboard:
    print("ready" if keyboard.usable else "no keys", flush=True)
    while True:
        for key in keyboard.pressed():
            print("<" + key.name + ">", flush=True)
            if key.name == "DOWN":
                raise SystemExit(0)
            if key.name == "UP":
                raise ValueError("failed")
        time.sleep(0.005)
"""


def test_keys_need_no_enter_and_are_not_shown() -> None:
    with Terminal(PROGRAM) as terminal:
        assert terminal.echoes
        terminal.until_text("ready")
        assert not terminal.echoes
        terminal.press(b" x\x1b[C")
        terminal.until_text("<SPACE>")
        terminal.until_text("<RIGHT>")
        terminal.press(b"\x1bOC\x1bOB")
        assert terminal.end() == 0
        assert terminal.text.count("<RIGHT>") == 2
        assert "x" not in terminal.text.replace("exit", "")
        assert terminal.settings == terminal.found


def test_an_error_leaves_the_terminal_as_it_was() -> None:
    with Terminal(PROGRAM) as terminal:
        terminal.until_text("ready")
        terminal.press(b"\x1b[A")
        assert terminal.end() == 1
        assert "ValueError: failed" in terminal.text
        assert terminal.settings == terminal.found


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_the_terminal_as_it_was(number: signal.Signals) -> None:
    with Terminal(PROGRAM) as terminal:
        terminal.until_text("ready")
        terminal.process.send_signal(number)
        terminal.end()
        assert terminal.settings == terminal.found


SHELL = """
import os, signal, time
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGUSR1])
signal.signal(signal.SIGTTOU, signal.SIG_IGN)
child = os.fork()
if child:
    os.setpgid(child, child)
    os.tcsetpgrp(0, child)
    for _ in range(2):
        _, status = os.waitpid(child, os.WUNTRACED)
        print("stopped" if os.WIFSTOPPED(status) else "ended", flush=True)
        signal.sigwait([signal.SIGUSR1])
        os.kill(child, signal.SIGCONT)
    _, status = os.waitpid(child, 0)
    os._exit(os.waitstatus_to_exitcode(status))
signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGUSR1])
while os.tcgetpgrp(0) != os.getpid():
    time.sleep(0.01)
"""


def test_a_stopped_program_gives_the_terminal_back_and_takes_it_again() -> None:
    """Ctrl-Z under a shell, twice."""
    with Terminal(SHELL + PROGRAM) as terminal:
        terminal.until_text("ready")
        for _ in range(2):
            terminal.text = ""
            terminal.press(b"\x1a")
            terminal.until_text("stopped")
            assert terminal.settings == terminal.found
            terminal.process.send_signal(signal.SIGUSR1)
            terminal.until(lambda: not terminal.echoes, "the terminal to be taken again")
        terminal.press(b" \x1b[B")
        assert terminal.end() == 0
        assert "<SPACE>" in terminal.text
        assert terminal.settings == terminal.found


def test_without_a_terminal_there_are_no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    reading, writing = os.pipe()
    with os.fdopen(reading) as stream:
        os.write(writing, b" ")
        monkeypatch.setattr("sys.stdin", stream)
        with Keyboard() as keyboard:
            assert not keyboard.usable
            assert keyboard.pressed() == []
        assert stream.read(1) == " "  # it was left for others
        os.close(writing)


def test_keys_that_are_not_wanted_are_not_taken() -> None:
    with Terminal(PROGRAM.replace("Keyboard()", "Keyboard(wanted=False)")) as terminal:
        terminal.until_text("no keys")
        assert terminal.echoes


def test_a_background_program_leaves_the_terminal_alone() -> None:
    parent = "import os\nif os.fork():\n    os.wait()\n    os._exit(0)\nos.setpgid(0, 0)\n"
    with Terminal(parent + PROGRAM.replace("while True:", "for _ in range(20):")) as terminal:
        assert terminal.end() == 0
        assert "no keys" in terminal.text
        assert terminal.settings == terminal.found
