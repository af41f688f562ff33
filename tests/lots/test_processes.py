"""The processes of a lot end with the command, whatever ends it."""

import os
import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is one process")

ENOUGH = 60
"""Seconds in which what ends has ended on any machine; no result depends on them."""
CODE = """
import os, signal, time
from accelstudy.commands.ending import interruptible
from accelstudy.lots.processes import processes
signal.signal(signal.SIGINT, signal.default_int_handler)
def endless(campaign):
    os.write(1, b"at work\\n")
    time.sleep(1000)
with interruptible(), processes(3, 3) as mapped:
    list(mapped(endless, range(3)))
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGKILL"])
def test_no_worker_stays_and_none_says_a_word(name):
    """Ctrl-C comes to the whole group, others to the command alone."""
    command = subprocess.Popen([sys.executable, "-c", CODE], stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True,
                               start_new_session=True)  # fmt: skip
    try:
        for _ in range(3):
            assert command.stdout.readline() == "at work\n"
        number = getattr(signal, name)
        (os.killpg if number == signal.SIGINT else os.kill)(command.pid, number)
        # Pipes end when the last process that may write to them is gone.
        _, said = command.communicate(timeout=ENOUGH)
    finally:
        command.kill()
    assert said == ("" if number == signal.SIGKILL else "interrupted\n")


PROGRAM = """
import os, signal, time
from accelstudy.lots.processes import processes
signal.signal(signal.SIGTERM, lambda *_: os.write(1, b"handled\\n"))
def job(campaign):
    if campaign == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(1000 if campaign == "endless" else 0)
    return campaign
for _ in range(30):
    with processes(3, 5) as mapped:
        assert list(mapped(job, range(5))) == [0, 1, 2, 3, 4]
try:
    with processes(3, 3) as mapped:
        list(mapped(job, ["endless", "endless", "killed"]))
except ValueError as error:
    print(error, flush=True)
os.kill(os.getpid(), signal.SIGTERM)
"""


def test_a_worker_does_not_answer_to_signals_as_the_program_does():
    """The pool ends however often it is used, and where the system kills a worker, in one line."""
    program = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True,
                             timeout=ENOUGH)  # fmt: skip
    assert program.stdout.splitlines() == [
        "a process of the lot was killed, most likely because memory ran out; use fewer `cores`",
        "handled",
    ]
    assert not program.stderr
