"""What an estimate needs of memory for each row of a log, from compiled programs: two hours at 100 Hz fit into a laptop."""

import jax
import jax.numpy as jnp
import method_logs
import numpy as np
import pytest
from test_every_method import QUANTITIES, made

from jaxveh import estimators, filters
from jaxveh.estimators import kit, parameter_bands
from jaxveh.estimators.cleaning import RearAxleCleaning, clean
from jaxveh.estimators.following import smooth_rows

MOST = 2000
"""Bytes a row: results and intermediate values; what is read comes on top."""

PIECE, PIECES = 100, (4, 12)
"""Rows of a piece here, and pieces of a shorter and of a longer log."""


def bytes_a_row(program, given_of):
    """The slope of the memory of a compiled program over the rows of a log; `given_of(rows)` are its operands."""
    sizes = []
    for pieces in PIECES:
        compiled = program.lower(*given_of(pieces * PIECE + 1)).compile()
        memory = getattr(compiled, "compiled", compiled).memory_analysis()
        sizes.append(memory.temp_size_in_bytes + memory.output_size_in_bytes)
    return (sizes[1] - sizes[0]) / (PIECE * (PIECES[1] - PIECES[0]))


@pytest.fixture(autouse=True)
def short_pieces(monkeypatch):
    monkeypatch.setattr("jaxveh.numerics.pieces.PIECE", PIECE)


@pytest.mark.product
@pytest.mark.parametrize("quantity", [name for name in QUANTITIES if name != "sideslip"])
def test_a_recommended_method(quantity):
    method = made(quantity, QUANTITIES[quantity].RECOMMENDED)
    program = smooth_rows if isinstance(method, kit.AbstractSmoothable) else kit.follow_rows
    of = lambda rows: (
        method,
        jnp.linspace(0.0, 0.01 * rows, rows),
        {need.channel: jnp.zeros(rows) for need in method.needs},
    )
    assert bytes_a_row(program, of) < MOST


@pytest.mark.parametrize("smoothed", [True, False])
def test_sideslip_with_bands(smoothed):
    model = estimators.sideslip.model(method_logs.CAR)
    members = estimators.sideslip.live(method_logs.CAR).members
    log = clean(method_logs.log(estimators.sideslip.needs), RearAxleCleaning(2.7))
    one = model.rows(log)

    def of(rows):
        long = jax.tree.map(lambda leaf: jnp.asarray(np.resize(leaf, rows)), one)._replace(
            t=jnp.linspace(0.0, 0.01 * rows, rows)
        )
        if smoothed:
            return filters.Extended(), model, members, long, jnp.asarray(rows)
        names = estimators.rear_axle.RearAxleReport
        return filters.Extended(), members, long, names(*[jnp.zeros(rows) for _ in names._fields])

    program = parameter_bands._smoothed_with_members if smoothed else parameter_bands._std_of_members
    assert bytes_a_row(program, of) < MOST
