"""What functions of roads, manoeuvres and sensors are given may be traced, or is refused by name; and it is copied.

The functions and classes, and what is right for them, are those of `test_wrong_arguments`.
"""

import pytest
from families import arrays_among, is_made_inside_jit, keeps_copies
from test_wrong_arguments import CASES, right

pytestmark = pytest.mark.filterwarnings("ignore:A JAX array is being set as static:UserWarning")


@pytest.mark.parametrize(("name", "made"), CASES)
def test_a_number_may_be_traced_or_is_named(name, made):
    is_made_inside_jit(made, right(name, made))


@pytest.mark.parametrize(("name", "made"), CASES)
def test_a_number_of_numpy_is_a_number(name, made):
    """As one of `np.linspace`; it need not be one of Python."""
    given = right(name, made)
    for argument, value in arrays_among(made, given).items():
        if not value.ndim:
            made(**given | {argument: value[()]})


@pytest.mark.parametrize(("name", "made"), CASES)
def test_what_is_given_is_copied(name, made):
    keeps_copies(made, right(name, made))
