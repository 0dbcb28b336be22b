"""Real-time priority if limits allow: for the threads of the event loop and the stop, but not for an endless loop."""

from __future__ import annotations

import json
import subprocess
import sys

SCRIPT = """
import json, os, resource, subprocess, sys, threading, time
from robots.shared.processes import scheduling

allowed = int(sys.argv[1])
limits = resource.getrlimit
resource.getrlimit = lambda which: (allowed, allowed) if which == resource.RLIMIT_RTPRIO else limits(which)

def policy():
    return os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK

got = scheduling.ask_for_priority()
of = {"got": got, "loop": policy()}

def in_thread(work):
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()

in_thread(lambda: of.update(thread=policy()))
in_thread(lambda: (scheduling.ask_for_stop_priority(), of.update(stop_thread=policy())))
ask = "import os; print(os.sched_getscheduler(0))"
of["child"] = int(subprocess.run([sys.executable, "-c", ask], capture_output=True, check=True).stdout)
end = time.monotonic() + 10
while policy() != os.SCHED_OTHER and time.monotonic() < end:
    sum(range(10000))  # runs away
of["at_last"] = policy()
print(json.dumps(of))
"""
OTHER, FIFO = 0, 1


def asked(allowed: int) -> dict[str, object]:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(allowed)], capture_output=True, check=True, text=True, timeout=60
    )
    return json.loads(done.stdout)


def test_an_allowed_loop_has_real_time_priority_until_runaway():
    found = asked(10)
    refused = str(found["got"]).startswith("ordinary priority (")  # this account may not get it
    assert refused or found["got"] == "real-time priority 5"
    assert found["loop"] == (OTHER if refused else FIFO)
    assert found["stop_thread"] == found["loop"]
    assert (found["thread"], found["child"], found["at_last"]) == (OTHER, OTHER, OTHER)


def test_without_permission_priority_stays_unchanged():
    found = asked(0)
    assert found["got"] == "ordinary priority"
    assert {found[name] for name in ("loop", "thread", "stop_thread", "child", "at_last")} == {OTHER}


def test_a_process_that_renounced_priority_gets_none():
    script = "from robots.shared.processes import scheduling as s; s.forbid_real_time(); print(s.ask_for_priority())"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, check=True, text=True, timeout=60
    )
    assert done.stdout.strip() == "ordinary priority"
