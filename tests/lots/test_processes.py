"""The processes of a lot end with the command, whatever ends it."""

import os
import signal
import subprocess
import sys
from multiprocessing import active_children

import pytest

from accelstudy.lots.lot import _processes

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is one process")

ENOUGH = 60
"""Seconds in which what ends has ended on any machine; no result depends on them."""
CODE = """
import os, signal, time
from accelstudy.commands.ending import interruptible
from accelstudy.lots.lot import _processes
signal.signal(signal.SIGINT, signal.default_int_handler)
def endless(campaign):
    os.write(1, b"at work\\n")
    time.sleep(1000)
with interruptible(), _processes(3, 3) as mapped:
    list(mapped(endless, range(3)))
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGKILL"])
def test_no_worker_stays_and_none_says_a_word(name):
    """Ctrl-C comes to the whole group, others to the command alone."""
    command = subprocess.Popen([sys.executable, "-c", CODE], stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True,
                               start_new_session=True)  # fmt: skip
    try:
        for _ in range(3):
            assert command.stdout.readline() == "at work\n"
        number = getattr(signal, name)
        if number == signal.SIGINT:
            os.killpg(command.pid, number)
        else:
            command.send_signal(number)
        # Pipes end when the last process that may write to them is gone.
        _, said = command.communicate(timeout=ENOUGH)
    finally:
        command.kill()
    assert said == ("interrupted\n" if number == signal.SIGINT else "")


def test_there_are_no_more_processes_than_campaigns():
    before = set(active_children())
    with _processes(200, 3) as mapped:
        assert list(mapped(abs, [-1, -2, -3])) == [1, 2, 3]
        assert len(set(active_children()) - before) == 3
    assert not set(active_children()) - before
