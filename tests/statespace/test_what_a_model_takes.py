"""Functions of other arguments, and arrays where a model has one number, are told by name before a run."""

import inspect
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from families import members

from jaxveh import InputError, Recording, filters
from jaxveh import statespace as ss
from jaxveh.filters import kit
from jaxveh.kit import record_type
from jaxveh.statespace.one_model import LEVELS

State, Seen = record_type("State", ("p", "v")), record_type("Seen", ("p",))
RECORDING = Recording(np.arange(4.0), {"p": np.arange(4.0)})


def move(system, t0, t1, x, u):
    return State(x.p + (t1 - t0) * x.v, x.v)


def see(system, t, x, u):
    return Seen(x.p)


def rates(system, t, x, u):
    return State(x.v, 0.0 * x.v)


def model(**given):
    prior = ss.Prior(State(0.0, 0.0), {"p": 1.0, "v": 1.0})
    process, measured = ss.Continuous(ss.Gaussian({"v": 0.3})), ss.Gaussian({"p": 0.1})
    usual = dict(transition=move, observation=see, process_noise=process, measurement_noise=measured, prior=prior)
    return ss.StateSpace(**usual | given)


FUNCTIONS = {
    ("StateSpace", "transition"): (5, lambda f: model(transition=f), "StateSpace: transition"),
    ("StateSpace", "observation"): (4, lambda f: model(observation=f), "StateSpace: observation"),
    ("StateSpace", "report"): (4, lambda f: model(report=f), "StateSpace: report"),
    ("Propagate", "derivatives"): (4, ss.Propagate, "Propagate: derivatives"),
    ("PerPoint", "function"): (5, lambda f: model(transition=ss.PerPoint(f)), r"StateSpace: transition\.function"),
    ("StateDependent", "function"): (4, lambda f: ss.StateDependent(f, "p"), r"StateDependent\.function"),
}
"""The functions that classes of the room take: the number of their arguments, what is made of them, and the name in a message."""

ANY = [lambda: 0, lambda a: 0, lambda a, b: 0, lambda a, b, c: 0, lambda a, b, c, d: 0, lambda a, b, c, d, e: 0]
ANY += [lambda a, b, c, d, e, f: 0, lambda a, b, c, *, d: 0]


def test_every_function_that_a_class_takes_is_here():
    taken = {
        (name, one.name)
        for name in ss.__all__
        if inspect.isclass(kind := getattr(ss, name)) and not issubclass(kind, tuple)
        for one in inspect.signature(kind).parameters.values()
        if "Callable" in str(one.annotation)
    }
    assert taken == set(FUNCTIONS)


@pytest.mark.parametrize("where", FUNCTIONS, ids=".".join)
def test_a_function_of_other_arguments_is_told_at_once(where):
    count, make, name = FUNCTIONS[where]
    for n, wrong in enumerate(ANY):
        if n != count:
            with pytest.raises(InputError, match=rf"{name} takes \(.*\): must take \(system, t.*x, u\)\."):
                make(wrong)
    make(ANY[count])
    make(lambda *given: 0)
    for wrong in (3, "a", State, *([] if where[1] == "report" else [None])):
        with pytest.raises(InputError, match=f"{name} = .*: must be a function"):
            make(wrong)


def test_rates_of_another_kind_are_told_and_a_record_of_the_same_fields_is_taken():
    own = record_type("Rates", ("p", "v"))
    run = lambda f: filters.run(filters.Unscented(), model(transition=ss.Propagate(f)), RECORDING)
    with pytest.raises(
        InputError, match=r"Propagate: derivatives returned tuple: must return the rates, State\(p, v\)"
    ):
        run(lambda system, t, x, u: (x.v, x.v))
    np.testing.assert_array_equal(run(lambda *a: own(*rates(*a))).mean.p, run(rates).mean.p)


LAWS = {
    ss.Gaussian: lambda std: ss.Gaussian({"p": std}),
    ss.StudentT: lambda dof, scale: ss.StudentT(dof, {"p": scale}),
    ss.CauchyGaussianMixture: lambda weight, scale, std: ss.CauchyGaussianMixture(weight, {"p": scale}, {"p": std}),
}
NUMBER = {"std": 0.1, "scale": 0.1, "dof": 4.0, "weight": 0.1}


def test_every_law_of_scalars_is_here():
    laws = set(members("statespace", ss.AbstractNoise)) - {"Independent", "MultivariateGaussian"}
    assert {kind.__name__ for kind in LAWS} == laws and set(LEVELS) == set(LAWS)


@pytest.mark.parametrize("kind", LAWS, ids=lambda kind: kind.__name__)
def test_a_level_that_is_an_array_is_told_before_a_run(kind):
    for wrong, shape in itertools.product(LEVELS[kind], ((1,), (3,), (2, 2))):
        law = LAWS[kind](
            **{name: np.full(shape, NUMBER[name]) if name == wrong else NUMBER[name] for name in LEVELS[kind]}
        )
        for place, made in {
            "measurement_noise": model(measurement_noise=law),
            "process_noise": model(process_noise=ss.Discrete(law)),
            "prior": model(prior=ss.Prior(State(0.0, 0.0), ss.Independent((law, ss.Gaussian({"v": 1.0}))))),
        }.items():
            with pytest.raises(
                InputError, match=rf"{place}\.{wrong}: \w+ has shape \({shape[0]},.*: must be one number"
            ):
                made.rows(RECORDING)
        dependent = ss.StateDependent(lambda system, t, x, u, law=law: law, "p")
        with pytest.raises(InputError, match=rf"its law\.{wrong}: \w+ has shape"):
            dependent.at(None, 0.0, State(0.0, 0.0), ())
    model(measurement_noise=LAWS[kind](**{name: NUMBER[name] for name in LEVELS[kind]})).rows(RECORDING)


def test_several_models_are_still_run_by_vmap():
    stds = jnp.asarray([0.1, 0.2])
    run = lambda std: filters.run(filters.Kalman(), model(measurement_noise=ss.Gaussian({"p": std})), RECORDING)
    together = jax.vmap(run)(stds).log_likelihood
    np.testing.assert_allclose(together, [run(std).log_likelihood for std in stds], rtol=1e-12)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: ss.Prior(State("a", 0.0), {"p": 1.0, "v": 1.0}), "prior mean of p = 'a': must be a real number"),
        (lambda: ss.Prior(State(None, 0.0), {"p": 1.0, "v": 1.0}), "prior mean of p = None"),
        (lambda: ss.Prior(State(0.0, np.nan), {"p": 1.0, "v": 1.0}), "prior mean of v = nan: must be finite"),
        (lambda: model(prior=None), "prior = None: must be of the kind Prior"),
        (lambda: model(prior=(State(0.0, 0.0), 1.0)), "prior = tuple: must be of the kind Prior"),
        (lambda: ss.Continuous(0.1), r"Continuous: law = 0\.1: must be of the kind Noise"),
        (lambda: ss.Discrete({"v": 0.1}), "Discrete: law = dict: must be of the kind Noise"),
        (lambda: ss.Independent((1.0,)), r"Independent: a law = 1\.0"),
        (lambda: ss.Propagate(rates, steps=0), "Propagate: steps = 0: must be a whole number of at least 1"),
        (lambda: model().row(0.0, {}, {"p": np.ones(2)}), r"row: p has the shape \(2,\)"),
        (lambda: ss.start_from(model(), p=np.ones(2)), r"start_from: p has the shape \(2,\)"),
        (lambda: ss.start_from(model(), p="a"), "start_from: p = 'a'"),
        (lambda: ss.with_disturbances(model(), {"v": np.ones(2)}), r"prior of v has the shape \(2,\)"),
        (lambda: ss.uncertain_inputs(model(inputs="w"), {"w": np.ones(2)}), r"uncertain_inputs: w has the shape \(2,\)"),
    ],
)  # fmt: skip
def test_what_is_no_number_or_law_is_told_at_once(make, words):
    with pytest.raises(InputError, match=words):
        make()


def test_variances_are_one_for_each_channel():
    made = model()
    assert kit.variances_of(kit.with_variances(made, [0.25])).tolist() == [0.25]
    for wrong in (np.ones(2), np.ones((1, 1)), 1.0):
        with pytest.raises(InputError, match=r"variances has shape \(.*\): must be \(1,\), one for each of p\."):
            kit.with_variances(made, wrong)
    for wrong, words in (
        (None, "= None: must be a real number"),
        ("a", "= 'a'"),
        ([-1.0], "must be positive"),
        ([np.nan], "nan"),
    ):
        with pytest.raises(InputError, match=f"with_variances: variances.*{words}"):
            kit.with_variances(made, wrong)
    with pytest.raises(InputError, match=r"variances has shape \(2,\)"):
        jax.jit(lambda values: kit.with_variances(made, values).measurement_noise.std)(jnp.ones(2))
