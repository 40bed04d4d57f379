"""What a filter declares is what it does: each of `FILTERS`, each capability, both ways.

A filter is one program, which all of its tests share: the recordings are of one length, with empty rows behind the last, and what
takes the noise of a row is always told one, that of the model where nothing else is said. (That it is then the filter itself is
in test_data_reality; in `-m full`, of each.)
"""

import functools
import inspect
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from test_every_filter import FILTERS as EVERY
from test_every_filter import Line, linear, recordings

from jaxveh import InputError, filters, observers
from jaxveh import statespace as ss
from jaxveh._core.names import record_type
from jaxveh.statespace.capabilities import who_lacks
from jaxveh.statespace.contract import (
    AbstractFilter,
    AbstractTwoPartWrapper,
    AbstractWrapper,
    Smoothing,
    innermost,
    layers,
)

CLASSES = [
    cls
    for room in (filters, observers)
    for cls in (getattr(room, name) for name in room.__all__)
    if isinstance(cls, type) and issubclass(cls, AbstractFilter) and not inspect.isabstract(cls)
]
FILTERS = EVERY | {
    "paused": Line(lambda: filters.Paused(filters.Cubature(), "force", {"x0": 1.0}), exact=False),
}
LEARNERS = [cls for cls in CLASSES if issubclass(cls, filters.kit.AbstractLearnedNoise)]
FLAGS = ("whitens", "noise_by_row", "rows_between")
HUGE, ROW = 1e6, 12

BETWEEN = 2
"""Empty rows put between each two."""

# Capabilities are those of classes: of lines of the same classes the last.
KINDS = {tuple(type(layer) for layer in layers(line.make())): name for name, line in FILTERS.items()}
ONCE = [name for name in FILTERS if name in KINDS.values()]
# Of an earlier row is what one shows that is late.
NOW = [name for name in ONCE if not FILTERS[name].late]
DRAWN, NOT_DRAWN = [n for n in ONCE if FILTERS[n].drawn], [n for n in NOW if not FILTERS[n].drawn]
NOT_TOLD = {"interacting": "its second mode sets a noise itself", "paused": "the row is one of a pause"}


def filter_named(name):
    return FILTERS[name].make()


def able(name, flag):
    return who_lacks(filter_named(name), flag) is None


def scanned(filter_, model, rows, key=0):
    return filters.scan(filter_, model, rows, jax.random.key(key))


def told(name):
    """The filter, told the spread of its first channel where it can be."""
    filter_ = filter_named(name)
    return filters.VaryingNoise(filter_, {"y0": "told"}) if name in TOLD else filter_


TOLD = [n for n in NOW if able(n, "noise_by_row") and n not in NOT_TOLD]


def told_model(own):
    """A model, with an input that tells the spread of its first channel."""
    model = own()
    return ss.StateSpace(
        system=model.system, transition=model.transition_function, observation=model.observation_function,
        process_noise=model.process_noise, measurement_noise=model.measurement_noise, prior=model.prior,
        inputs=("force", "told"),
    )  # fmt: skip


@functools.cache
def turned():
    """A recording of `turning`, at the instants and with the gaps of another one."""
    recording, model = recordings("linear")[0], turning()
    x, rng, seen = model.prior.mean, np.random.default_rng(8), []
    rows = model.rows(recording)
    for k in range(25):
        row = jax.tree.map(lambda leaf, k=k: leaf[k], rows)
        x = x if k == 0 else model.transition(rows.t[k - 1], row.t, x, row.u)
        seen.append(model.observation(row.t, x, row.u))
    noise = {"y0": 0.4, "y1": 0.3}
    values = {
        name: np.where(np.isnan(recording[name]), np.nan, [float(getattr(y, name)) for y in seen])
        + noise[name] * rng.normal(size=25)
        for name in model.channels
    }
    return recording.replace(**values)


def told_rows(model, values=None, y0=None):
    recording = recordings("linear")[0] if model.process_noise is not None else turned()
    channels = {name: np.array(recording[name]) for name in (*model.channels, "force")}
    if y0 is not None:
        channels["y0"][ROW] = y0
    rows = model.rows(recording.replace(**channels, told=np.full(25, 0.4) if values is None else values))
    return jax.tree.map(np.asarray, rows)


def filled(rows):
    """Empty rows behind the last, up to as many as there are with others between: all are one program."""
    count = 25 + 24 * BETWEEN - rows.t.size
    later = jax.tree.map(lambda leaf: np.append(leaf, np.full(count, leaf[-1])), rows)
    t = rows.t[-1] + 0.1 * np.arange(1.0, count + 1.0)
    y = jax.tree.map(lambda leaf: np.append(leaf, np.full(count, np.nan)), rows.y)
    return later._replace(t=np.append(rows.t, t), y=y)


def own_model(name):
    """Where nothing is drawn the one of all other capabilities, so that they share a program."""
    # Strong tracking's one factor for all channels is 1 at the row only where process noise explains the residuals before.
    return linear if FILTERS[name].drawn or name == "strong tracking" else turning


@functools.cache
def answer(name, what, own=None):
    """The estimate of a filter's rows: `plain`, `longer` by empty rows between, or with y0 of one row `missing`, `given`, or of a
    `huge` spread."""
    model = told_model(own or own_model(name))
    values = np.full(25, 0.4)
    values[ROW] = HUGE if what == "huge" else 0.4
    rows = told_rows(model, values, {"missing": np.nan, "given": 3.0, "huge": 0.5}.get(what))
    return scanned(told(name), model, filled(with_empty_rows(rows, BETWEEN) if what == "longer" else rows))


@pytest.mark.parametrize("name", TOLD)
def test_noise_of_a_row_is_taken_as_it_is_told(name):
    """A channel of a huge spread in one row is as good as missing there."""
    huge, missing, given = (answer(name, what) for what in ("huge", "missing", "given"))
    for found, expected in zip(huge.mean, missing.mean, strict=True):
        np.testing.assert_allclose(found[: ROW + 1], expected[: ROW + 1], rtol=1e-4, atol=1e-4)
    assert abs(given.mean.x0[ROW] - missing.mean.x0[ROW]) > 1e-3


@pytest.mark.full  # By default of one filter in test_data_reality: what is told is written into the model of any.
@pytest.mark.parametrize("name", TOLD)
def test_told_the_model_s_own_noise_it_is_the_filter_itself(name):
    model = told_model(own_model(name))
    plain, told_it = scanned(filter_named(name), model, filled(told_rows(model))), answer(name, "plain")
    np.testing.assert_allclose(np.stack(told_it.mean), np.stack(plain.mean), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", [n for n in ONCE if not able(n, "noise_by_row")])
def test_a_filter_with_a_noise_of_its_own_is_refused(name):
    model, kind = told_model(linear), who_lacks(filter_named(name), "noise_by_row")
    for outer in (lambda f: filters.VaryingNoise(f, {"y0": "told"}), filters.Huber, filters.RobustStudentT):
        if outer in (filters.Huber, filters.RobustStudentT) and not isinstance(
            filter_named(name), filters.AbstractGaussianFilter
        ):
            continue
        with pytest.raises(InputError, match=rf"{kind} inside it does not take .* Put \w+ inside: {kind}\("):
            outer(filter_named(name)).check(model)
    for outer in LEARNERS:
        if isinstance(filter_named(name), filters.AbstractGaussianFilter):
            with pytest.raises(InputError, match=rf"{outer.__name__}: {kind} inside .* would do nothing. Take one of"):
                outer(filter_named(name)).check(model)


def turn(system, t0, t1, x, u):
    """A turn that dies away, and an offset of it that dies away more slowly: two steps are exactly one over both."""
    dt, share = t1 - t0, system["offset"]
    turned, fading = jnp.exp(-0.1 * dt), jnp.exp(-0.05 * dt)
    cos, sin, x0 = turned * jnp.cos(2.0 * dt), turned * jnp.sin(2.0 * dt), x.x0 - share * x.x2
    return type(x)(cos * x0 + sin * x.x1 + share * fading * x.x2, cos * x.x1 - sin * x0, fading * x.x2)


def turning():
    names = ("x0", "x1", "x2")
    model = linear()
    return ss.StateSpace(
        system={**model.system, "offset": jnp.asarray(np.array(0.3))}, transition=turn,
        observation=model.observation_function, process_noise=None, measurement_noise=model.measurement_noise,
        prior=ss.Prior(record_type("X", names)(0.5, 0.0, 0.1), dict.fromkeys(names, 1.0)), inputs=("force",),
    )  # fmt: skip


def test_two_steps_of_the_model_are_one_over_both():
    x, turn_by = turning().prior.mean, lambda t0, t1, x: turn({"offset": 0.3}, t0, t1, x, None)
    np.testing.assert_allclose(turn_by(0.1, 0.3, turn_by(0.0, 0.1, x)), turn_by(0.0, 0.3, x), rtol=1e-13)


def with_empty_rows(rows, count):
    """`count` rows without a measurement put between each two, at which the inputs are still those of the row before."""
    parts = np.arange(count + 1) / (count + 1)
    t = rows.t
    times = np.append((t[:-1, None] + np.diff(t)[:, None] * parts).reshape(-1), t[-1])
    place = np.arange(times.size) // (count + 1)
    real = np.arange(times.size) % (count + 1) == 0
    taken = jax.tree.map(lambda leaf: leaf[place], rows)
    return taken._replace(t=times, y=jax.tree.map(lambda leaf: np.where(real, leaf, np.nan), taken.y))


def beside(name):
    """Estimates of the rows that both have: as they are, and with two empty rows between each two."""
    shown = lambda found: np.stack([*found.mean, *found.std])
    return shown(answer(name, "plain", turning))[:, :25], shown(answer(name, "longer", turning))[:, :: BETWEEN + 1]


@pytest.mark.parametrize("name", [n for n in NOT_DRAWN if able(n, "rows_between")])
def test_empty_rows_between_change_nothing(name):
    plain, longer = beside(name)
    np.testing.assert_allclose(longer, plain, rtol=1e-6, atol=1e-6)


# It keeps rows of its own, and no others: rows put between them would push them out.
UNCHANGED = "delayed, in order"


@pytest.mark.parametrize("name", [n for n in NOT_DRAWN if not able(n, "rows_between") and n != UNCHANGED])
def test_what_acts_in_each_step_is_changed_by_empty_rows_and_refused(name):
    plain, longer = beside(name)
    assert np.abs(longer - plain).max() > 1e-4
    with pytest.raises(
        InputError, match=f"{who_lacks(filter_named(name), 'rows_between')} inside it takes no late rows"
    ):
        filters.Delayed(filter_named(name)).check(turning())


@pytest.mark.parametrize("name", DRAWN)
def test_the_spread_of_particles_without_measurements_depends_on_time_alone(name):
    """Over 40 rows as over 4: their own number of draws makes spreads scatter by 5 %."""
    model, ends = told_model(linear), []
    few = jax.tree.map(lambda leaf: leaf[:4], told_rows(model))
    few = few._replace(y=jax.tree.map(lambda leaf: np.full(4, np.nan), few.y))
    for given in (few, with_empty_rows(few, 12)):
        stds = [np.stack(scanned(told(name), model, filled(given), key).std)[:, given.t.size - 1] for key in range(4)]
        ends.append(np.sqrt(np.mean(np.square(stds), axis=0)))
    # The transition is Heun's or Euler's, whose steps are not those of their sum: the spread of it differs by a little.
    ratio = ends[1] / ends[0]
    if able(name, "rows_between"):
        assert np.all(np.abs(ratio - 1.0) < 0.25), ratio
    else:
        assert np.any(ratio > 1.3), ratio


@pytest.mark.parametrize("name", NOT_DRAWN)
def test_whitened_innovations_add_up_where_they_are_declared(name):
    found = answer(name, "plain", turning)
    if not able(name, "whitens"):
        kind = who_lacks(filter_named(name), "whitens")
        assert found.info.whitened is None, (
            f"{kind} hands on whitened innovations, and does not declare it: whitens = True"
        )
        return
    white, scale = np.stack(found.info.whitened), np.stack(found.info.log_scale)
    here = np.isfinite(np.stack(found.info.innovation))
    sums = np.sum(np.where(here, -0.5 * white**2 - scale - 0.5 * np.log(2 * np.pi), 0.0))
    np.testing.assert_allclose(sums, found.log_likelihood, rtol=1e-9)


@pytest.mark.parametrize("name", DRAWN)
def test_what_draws_needs_a_key_and_nothing_else_does(name):
    filter_, model = filter_named(name), linear()
    assert filter_.needs_key
    row = jax.tree.map(lambda leaf: leaf[0], model.rows(recordings("linear")[0]))
    with pytest.raises(InputError, match=f"{type(innermost(filter_)).__name__} draws random numbers: give it a key"):
        filter_.init(model, row)


def test_nothing_else_needs_a_key():
    assert not [name for name, line in FILTERS.items() if line.make().needs_key and not line.drawn]


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_what_goes_around_a_filter_calls_it_inner(cls):
    fields = {field.name: field for field in cls.__dataclass_fields__.values()}
    around = "inner" in fields
    assert around == issubclass(cls, AbstractWrapper)
    assert "filter" not in fields
    for flag in FLAGS:
        assert isinstance(getattr(cls, flag), bool)
    assert isinstance(cls.smooths, Smoothing)


def test_layers_end_with_what_goes_around_nothing():
    for name in FILTERS:
        found = layers(filter_named(name))
        assert not isinstance(found[-1], AbstractWrapper) and found[-1] is innermost(found[0])
        assert all(isinstance(layer, AbstractWrapper) for layer in found[:-1])


@pytest.mark.parametrize("method", ["init", "step"])
def test_init_and_step_are_final(method):
    with pytest.raises(TypeError, match=f"{method}: is final. Write _{method}"):
        type("Own", (filters.Kalman,), {method: lambda self, *given: None})


@pytest.mark.parametrize("method", ["predict", "update"])
def test_a_wrapper_does_not_write_a_part_that_nothing_calls(method):
    written = {method: lambda self, *given: None, "__annotations__": {"inner": filters.kit.AbstractGaussianFilter}}
    with pytest.raises(TypeError, match=f"Own.{method}: nothing calls it.* Write _{method}"):
        type(AbstractTwoPartWrapper)("Own", (AbstractTwoPartWrapper,), written)


class Wider(AbstractTwoPartWrapper):
    """Of a user: predictions wider by a factor."""

    inner: filters.AbstractGaussianFilter
    factor: float = eqx.field(static=True, default=2.0)
    noise_by_row: ClassVar[bool] = True

    def _predict(self, model, belief, row):
        return self.inner._predict(model, belief, row).inflate(jnp.asarray(self.factor))


def test_a_wrapper_of_one_part_changes_that_part_alone():
    model = linear()
    rows = model.rows(recordings("linear")[0])
    found, plain = scanned(Wider(filters.Kalman()), model, rows), scanned(filters.Kalman(), model, rows)
    np.testing.assert_array_equal(found.mean.x0[0], plain.mean.x0[0])
    assert found.std.x0[5] > 1.05 * plain.std.x0[5]
    one = scanned(Wider(filters.Kalman(), 1.0), model, rows)
    np.testing.assert_allclose(one.mean.x0, plain.mean.x0, rtol=1e-12)
    with pytest.raises(InputError, match="Wider inside it takes no late rows"):
        filters.Delayed(Wider(filters.Kalman())).check(model)
    with pytest.raises(InputError, match="Wider: FixedLag inside: must be a filter whose step is a prediction"):
        Wider(filters.FixedLag(filters.Kalman(), 2))
