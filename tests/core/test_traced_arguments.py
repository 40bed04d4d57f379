"""What functions of roads, manoeuvres and sensors are given may be traced, or is refused by name; and it is copied.

The functions and classes, and what is right for them, are those of `test_wrong_arguments`.
"""

import jax
import numpy as np
import pytest
from families import arrays_among, is_made_inside_jit, keeps_copies, or_refused
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


@pytest.mark.parametrize(("name", "made"), CASES)
def test_a_list_is_an_array(name, made):
    """What is given as a list of numbers is what an array of them is, and refused where that is."""
    given = right(name, made)
    for argument, value in arrays_among(made, given).items():
        pair = np.stack([value, value])
        one, other = (
            or_refused(lambda several=several, argument=argument: made(**given | {argument: several}), argument)
            for several in (pair, pair.tolist())
        )
        leaves = [jax.tree.leaves(it) for it in (one, other)]
        assert [np.shape(leaf) for leaf in leaves[0]] == [np.shape(leaf) for leaf in leaves[1]], argument
        for a, b in zip(*leaves, strict=True):
            assert not isinstance(a, jax.Array) or np.array_equal(a, b, equal_nan=True), argument
