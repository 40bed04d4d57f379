"""No child outlives its program, however that ends; with small programs that load one module."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import jaxveh

MODULE = Path(jaxveh.__file__).parent / "cli" / "family.py"

LOAD = f"""
import importlib.util, os, signal, sys, time
spec = importlib.util.spec_from_file_location("family", {str(MODULE)!r})
family = importlib.util.module_from_spec(spec)
spec.loader.exec_module(family)
"""

CHILD = """
family.GRACE = 1.0
family.end_with_parent()
if sys.argv[2] == "deaf":
    signal.signal(signal.SIGINT, signal.SIG_IGN)
open(sys.argv[1], "w").write(str(os.getpid()))
time.sleep(100)
"""

PARENT = """
from concurrent.futures import ThreadPoolExecutor
children = family.Family()
def go(i):
    command = [sys.executable, "-c", os.environ["CHILD"], f"{sys.argv[1]}/{i}", ("obedient", "deaf")[i % 2]]
    with children.child(command, sys.stdout):
        pass
with family.ends_in_order(), ThreadPoolExecutor(2) as pool:
    try:
        list(pool.map(go, range(4)))
    except BaseException:
        children.end()
        pool.shutdown(wait=False, cancel_futures=True)
        raise
"""


def lives(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="looks for processes in /proc")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP", "SIGKILL"])
def test_children_end_with_their_parent(tmp_path, name):
    env = {**os.environ, "CHILD": LOAD + CHILD}
    parent = subprocess.Popen([sys.executable, "-c", LOAD + PARENT, str(tmp_path)], env=env, stderr=subprocess.PIPE)
    wait_for(lambda: sum(bool(file.read_text()) for file in tmp_path.iterdir()) == 2)
    children = [int(file.read_text()) for file in tmp_path.iterdir()]
    assert all(map(lives, children))
    parent.send_signal(getattr(signal, name))
    parent.communicate(timeout=60)
    wait_for(lambda: not any(map(lives, children)))
    assert len(list(tmp_path.iterdir())) == 2  # those in the queue never began
    codes = {"SIGINT": (-2, 1), "SIGTERM": (143,), "SIGHUP": (129,), "SIGKILL": (-9,)}
    assert parent.returncode in codes[name]


def test_a_child_that_is_done_ends_in_order():
    source = (
        LOAD
        + """
with family.Family().child([sys.executable, "-c", os.environ["CHILD"]], sys.stdout, OWN="1") as child:
    said = child.stderr.read()
sys.exit(f"{child.returncode} {said}" if child.returncode or said else 0)
"""
    )
    env = {**os.environ, "CHILD": LOAD + "family.end_with_parent()\nassert os.environ['OWN'] == '1'\ntime.sleep(0.2)"}
    done = subprocess.run([sys.executable, "-c", source], env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def wait_for(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)
