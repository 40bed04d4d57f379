"""What functions of roads, manoeuvres and sensors are given may be traced, or is refused by name; and it is copied.

The functions and classes, and what is right for them, are those of `test_wrong_arguments`.
"""

import pytest
from families import is_made_inside_jit, keeps_copies
from test_wrong_arguments import CASES, right

pytestmark = pytest.mark.filterwarnings("ignore:A JAX array is being set as static:UserWarning")


@pytest.mark.parametrize(("name", "made"), CASES)
def test_a_number_may_be_traced_or_is_named(name, made):
    is_made_inside_jit(made, right(name, made))


@pytest.mark.parametrize(("name", "made"), CASES)
def test_what_is_given_is_copied(name, made):
    keeps_copies(made, right(name, made))
