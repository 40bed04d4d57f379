"""A class of one's own, derived from any base of the package: what its methods return and take is checked by name.

The bases are those of `__all__`; what a base asks for and no check looks at has a reason.
"""

import abc
import inspect
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxveh
from jaxveh import InputError, estimators, sensors, tyres, vehicles
from jaxveh import statespace as ss
from jaxveh._core.contracts import Checked, contract
from jaxveh._core.own_results import not_none, numbers_as_given
from jaxveh.kit import Interval, parameter, positive, record, record_type
from jaxveh.numerics import sigma_points

Seen = record_type("Seen", ("speed",))
ROOMS = ("tyres", "roads", "manoeuvres", "sensors", "vehicles", "filters", "statespace", "observers", "estimators")


def listed(room):
    room = getattr(jaxveh, room)
    for part in (room, getattr(room, "kit", None)):
        yield from ((name, getattr(part, name)) for name in getattr(part, "__all__", ()))


BASES = {
    name: base
    for room in ROOMS
    for name, base in listed(room)
    if inspect.isclass(base) and getattr(base, "__abstractmethods__", ()) and issubclass(base, Checked)
}


def contract_of(base):
    return {name: check for one in reversed(base.__mro__) for name, check in vars(one).get("_contract", {}).items()}


UNCHECKED = {
    "check": "returns nothing",
    **dict.fromkeys(("inner", "form", "device", "channel", "rate", "delay", "phase", "duration"), "a field"),
    "positive": "a flag",
    **dict.fromkeys(("start", "correct", "predict"), "of an observer: its `_update` returns what these made"),
    "ahead": "the belief of a smoother, which differs with the method",
    **dict.fromkeys(
        ("loads", "steady_a_x", "wheel_speed", "contacts", "own_states", "tyres"),
        "a part of a vehicle of the package: its `evaluate` returns what these made",
    ),
}


def test_every_base_checks_what_it_asks_for():
    assert {"AbstractTyre", "AbstractVehicle", "AbstractRoad", "AbstractManoeuvre", "AbstractMethod"} <= set(BASES)
    left = {
        f"{name}.{one}" for name, base in BASES.items() for one in base.__abstractmethods__ - set(contract_of(base))
    }
    assert {one for one in left if one.split(".")[1] not in UNCHECKED} == set()


def own(base, name, made):
    """A class of one's own whose method or property `name` is `made`."""
    return type(base)("Own", (base,), {name: made, "__module__": __name__, "__annotations__": {}})


def asked_of(base, name):
    """The method or property of a base, and the names of its arguments."""
    asked = inspect.getattr_static(base, name)
    if isinstance(asked, property):
        return asked, ()
    return getattr(base, name), tuple(inspect.signature(getattr(base, name)).parameters)[1:]


Own = type("Own", (), {"channels": ("q",), "state_names": ("slip",), "state_type": record_type("State", ("v_x",))})
"""Stands for an object of the class: what is abstract cannot be made."""

EVERY = [(base, name) for base in BASES for name in contract_of(BASES[base]) if name in BASES[base].__abstractmethods__]


@pytest.mark.parametrize(("base", "name"), EVERY)
def test_a_forgotten_return_is_said_by_name(base, name):
    asked, arguments = asked_of(BASES[base], name)
    if isinstance(asked, property):
        call = lambda: vars(own(BASES[base], name, property(lambda self: None)))[name].fget(Own())
    else:
        kinds = inspect.signature(asked).parameters
        positional = [one for one in arguments if kinds[one].kind is not inspect.Parameter.VAR_KEYWORD]
        # As many arguments, by names of one's own.
        words = [f"of_{one}" for one in positional] + ["**values"] * (len(positional) < len(arguments))
        method = getattr(own(BASES[base], name, eval(f"lambda self, {', '.join(words)}: None")), name)
        call = lambda: method(Own(), *[jnp.zeros(3)] * len(positional))
    with pytest.raises(InputError, match=rf"Own\.{name}"):
        call()


@pytest.mark.parametrize(("base", "name"), EVERY)
def test_a_method_of_other_arguments_is_refused_with_its_class(base, name):
    asked, arguments = asked_of(BASES[base], name)
    if isinstance(asked, property):
        with pytest.raises(TypeError, match=rf"Own\.{name}: is a property; write @property above it"):
            own(BASES[base], name, lambda self: ())
    else:
        with pytest.raises(TypeError, match=rf"Own\.{name}\(self\): must take \(self, {arguments[0]}"):
            own(BASES[base], name, lambda self: None)


def tyre(forces):
    made = {"c": positive("N/rad", default=6e4), "forces": forces, "__annotations__": {"c": jax.Array}}
    return type(tyres.AbstractTyre)("Law", (tyres.AbstractTyre,), {**made, "__module__": __name__})()


def limit(law, contact):
    if contact.slip_angle > 0.1:
        return tyres.Forces(F_y=0.1 * law.c)
    return tyres.Forces(F_y=law.c * contact.slip_angle)


LAWS = {
    "a number": (
        lambda law, at: law.c * at.slip_angle,
        r"returned an array of float64 of shape .*: must return Forces\(F_x, F_y, ",
    ),
    "no names": (lambda law, at: (0.0, law.c * at.slip_angle), r"Law.forces: returned tuple: must return Forces"),
    "an axis": (lambda law, at: tyres.Forces(F_y=jnp.ones(3)), r"Law.forces: F_y has shape \(3,\): .*given, \(\)"),
    "nothing": (lambda law, at: tyres.Forces(F_y=None), "Law.forces: F_y is None: must be a real number"),
    "complex": (
        lambda law, at: tyres.Forces(F_y=jax.lax.complex(at.slip_angle, 1.0)),
        "F_y is an array of complex128",
    ),
    "if": (limit, r"test_own_classes.py, line \d+, in limit: asks for the value .* jnp.where for `if`"),
    "numpy": (
        lambda law, at: tyres.Forces(F_y=np.tanh(at.slip_angle)),
        r"line \d+, in <lambda>: .* jax.numpy for numpy",
    ),
    "math": (lambda law, at: tyres.Forces(F_y=math.tanh(at.slip_angle)), r"line \d+, in <lambda>: .* math and float"),
}


@pytest.mark.parametrize("mistake", LAWS)
def test_mistakes_within_a_method(mistake):
    forces, words = LAWS[mistake]
    law = tyre(lambda self, contact, state=None: forces(self, contact))
    with pytest.raises(InputError, match=words):
        jax.eval_shape(lambda angle: law.forces(tyres.Contact(slip_angle=angle)), jnp.zeros(()))
    car = eqx.tree_at(lambda car: car.rear, vehicles.passenger_car(), law)
    with pytest.raises(InputError, match=words):
        estimators.state_space(car, sensors.esc(yaw_rate=0.005, a_y=0.1))


def device(units=None, said=lambda times: {"q": times, "p": times}):
    """A device of one's own that measures `q` and `p`."""
    made = {
        "rate": 10.0, "delay": 0.0, "phase": 0.0, "__module__": __name__, "channels": property(lambda self: ("q", "p")),
        "units": property(lambda self: {"q": "-", "p": "m"} if units is None else units),
        "needs": property(lambda self: ("v_x",)), "may_use": property(lambda self: ()),
        "say": lambda self, times, outputs, key: said(times),
    }  # fmt: skip
    return type(sensors.AbstractDevice)("Own", (sensors.AbstractDevice,), made)()


SAID = {
    "a channel too few": (
        lambda t: {"q": t},
        "Own.say: returned q: must return all these channels and no others: q, p",
    ),
    "one too many": (lambda t: {"q": t, "p": t, "r": t}, "Own.say: returned q, p, r: must return all these"),
    "none": (lambda t: {}, "Own.say: returned nothing: must return all these"),
    "no mapping": (lambda t: [t, t], "Own.say: returned .*list.*: must return a mapping from channels to arrays"),
    "one number": (lambda t: {"q": t, "p": t[0]}, r"Own.say: p is .*: must be an array \(4,\), a number for each time"),
}


@pytest.mark.parametrize("mistake", SAID)
def test_a_device_of_one_s_own_says_an_array_for_each_channel(mistake):
    said, words = SAID[mistake]
    with pytest.raises(InputError, match=words):
        device(said=said).say(jnp.zeros(4), {"v_x": jnp.zeros(4)}, None)


@pytest.mark.parametrize(
    ("units", "lacking"), [({"q": "-"}, "p"), ({}, "q, p"), ({"r": "-", "p": "m"}, "q"), ([], "q, p")]
)
def test_a_device_of_one_s_own_has_a_unit_for_each_channel(units, lacking):
    assert device().units == {"q": "-", "p": "m"}
    with pytest.raises(InputError, match=f"Own.units: has no {lacking}: each channel must have a unit"):
        device(units=units).units  # noqa: B018


def test_a_sound_class_answers_a_batch_and_its_derivatives():
    law = tyre(lambda self, contact, state=None: tyres.Forces(F_y=self.c * jnp.tanh(contact.slip_angle)))
    angles = jnp.linspace(-0.1, 0.1, 5)
    at = lambda angle: law.forces(tyres.Contact(slip_angle=angle)).F_y
    assert np.allclose(jax.jit(at)(angles), jax.vmap(at)(angles)) and at(angles).shape == (5,)
    assert np.isclose(jax.grad(at)(0.0), 6e4)


def test_a_table_among_the_parameters_is_no_axis_that_is_missed():
    """Neither lengths that do not broadcast, nor a batch of cars."""
    numbers_as_given("Law.forces", ({"curve": jnp.zeros(7), "speeds": jnp.zeros(3)}, 0.0), record("F", {"F_y": 1.0}))
    numbers_as_given("Law.forces", (jnp.zeros(4), jnp.zeros((2, 1))), record("F", {"F_y": jnp.zeros((2, 4))}))
    with pytest.raises(InputError, match=r"F_y has shape \(3, 2, 4\)"):
        numbers_as_given("Law.forces", jnp.zeros((2, 4)), record("F", {"F_y": jnp.zeros((3, 2, 4))}))


def test_an_error_of_jax_in_the_package_itself_stays_as_it_is():
    class Base(Checked):
        _contract = contract(value=not_none)

        @abc.abstractmethod
        def value(self, x):
            """Something."""

    class Size(Base):
        def value(self, x):
            return sigma_points.unscented(x)

    with pytest.raises(jax.errors.ConcretizationTypeError):
        jax.eval_shape(Size().value, 3)


MODELS = {
    "transition": (lambda s, t0, t1, x, u: x._replace(v_x=None), "transition: v_x is None: must be a real number"),
    "observation": (lambda s, t, x, u: Seen(jnp.zeros(9)), r"observation: speed has shape \(9,\): must be elementwise"),
    "report": (lambda s, t, x, u: x.v_x, "report: returned (an array of float64|[0-9.]+).*: must return a NamedTuple"),
}


@pytest.mark.parametrize("function", MODELS)
def test_a_model_function_is_named(function):
    wrong, words = MODELS[function]
    made = {"transition": lambda s, t0, t1, x, u: x, "observation": lambda s, t, x, u: Seen(x.v_x), function: wrong}
    x, noise = record("State", {"v_x": 20.0}), ss.Gaussian({"speed": 1.0})
    model = ss.StateSpace(**made, process_noise=None, measurement_noise=noise, prior=ss.Prior(x, {"v_x": 1.0}))
    given = {"transition": (0.0, 0.1, x, ()), "observation": (0.0, x, ()), "report": (0.0, x, ())}
    x = jax.tree.map(jnp.asarray, x)
    with pytest.raises(InputError, match=words):
        getattr(model, function)(*given[function])


def test_one_input_in_a_string_is_one_name():
    x = record("State", {"v_x": 20.0})
    model = ss.StateSpace(
        transition=lambda s, t0, t1, x, u: x, observation=lambda s, t, x, u: Seen(x.v_x), inputs="a_x",
        process_noise=None, measurement_noise={"speed": 1.0}, prior=ss.Prior(x, {"v_x": 1.0}),
    )  # fmt: skip
    assert model.inputs == ("a_x",)


@pytest.mark.parametrize("value", [-0.1, 0.0, 1.0, 1.3])
def test_a_parameter_stays_inside_its_interval(value):
    made = {"share": parameter("-", Interval(0.0, 1.0), default=0.9), "__annotations__": {"share": jax.Array}}
    body = {**made, "forces": lambda self, contact, state=None: tyres.Forces(), "__module__": __name__}
    kind = type(tyres.AbstractTyre)("Law", (tyres.AbstractTyre,), body)
    assert kind(0.5).share == 0.5
    with pytest.raises(InputError, match=rf"Law.share = {value}: must be above 0 and below 1"):
        kind(value)
