"""A class that `record_type` makes can be sent to another process, where it is the one that is made there."""

import pickle
import subprocess
import sys

import pytest

from jaxveh._core import names
from jaxveh._core.names import record, record_type

cloudpickle = pytest.importorskip("cloudpickle")

THERE = """
import pickle, sys
sent = pickle.loads(sys.stdin.buffer.read())
from jaxveh._core.names import record_type
assert sent is record_type("State", ("v_x", "yaw_rate")), sent
"""


@pytest.mark.parametrize("library", [pickle, cloudpickle])
@pytest.mark.parametrize("fields", [(), ("v_x",), ("v_x", "yaw_rate")])
def test_it_comes_back_as_itself(library, fields):
    kind = record_type("State", fields)
    assert library.loads(library.dumps(kind)) is kind
    one = record("State", dict.fromkeys(fields, 1.5))
    back = library.loads(library.dumps(one))
    assert back == one and type(back) is kind


@pytest.mark.parametrize("library", [pickle, cloudpickle])
def test_in_another_process_it_is_the_one_made_there(library):
    """Else jit would see two structures where there is one."""
    sent = library.dumps(record_type("State", ("v_x", "yaw_rate")))
    done = subprocess.run([sys.executable, "-c", THERE], input=sent, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()


def test_names_that_are_no_record_s_are_not_there():
    with pytest.raises(AttributeError, match="no attribute 'State'"):
        _ = names.State
