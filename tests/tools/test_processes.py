"""The status of processes, as the system calls tell it."""

from __future__ import annotations

import os
import subprocess
import sys

from fusesoc_firm.tools.processes import process_status, start_time

# Renames itself before it says that it is ready.
_ODD = "open('/proc/self/comm', 'w').write(') Z 1 2'); print(flush=True); input()"


def test_a_process_with_an_odd_name_is_described() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", _ODD], stdin=subprocess.PIPE, stdout=subprocess.PIPE, process_group=0
    ) as child:
        assert child.stdin and child.stdout
        child.stdout.readline()
        status = process_status(child.pid)
        group = os.getpgid(child.pid)
        child.stdin.close()
    assert status is not None
    assert (status.group, status.state in "RSD") == (str(group), True)
    assert int(status.started) >= int(start_time(os.getpid()))


def test_a_zombie_has_its_state_and_then_no_status() -> None:
    child = subprocess.Popen(["true"], stdout=subprocess.PIPE)
    os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)
    status = process_status(child.pid)
    assert status and status.state == "Z"
    child.communicate()
    assert process_status(child.pid) is None
    assert start_time(child.pid) == ""
