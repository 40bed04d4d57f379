"""Figures of one tyre, car or estimate: several, as `jax.vmap` returns them, and other things get one message."""

import types

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Recording, plots, tyres, vehicles

SLIPS = {"front": np.linspace(-0.1, 0.1, 5), "rear": np.linspace(-0.1, 0.1, 5)}
TYRES = {
    "tyre": plots.tyre,
    "friction_ellipse": lambda law: plots.friction_ellipse(law, 4000.0),
    "gradient_map": lambda law: plots.gradient_map(law, 4000.0),
    "force_curves": lambda law: plots.force_curves({"car": types.SimpleNamespace(front=law, rear=law)}, SLIPS),
}
LAWS = {"MagicFormula": vehicles.passenger_car().front, "Dugoff": tyres.Dugoff(60_000.0, 50_000.0, 1.0)}


def several(of):
    return jax.vmap(lambda scale: jax.tree.map(lambda leaf: leaf * scale, eqx.filter(of, eqx.is_array)))(jnp.ones(3))


@pytest.mark.parametrize("draw", TYRES.values(), ids=TYRES)
def test_one_tyre(draw):
    for name, law in LAWS.items():
        with pytest.raises(InputError, match=r"several tyres: must be one, such as jax.tree.map"):
            draw(several(law))
        assert name == type(law).__name__
    for other in ("tyre", vehicles.passenger_car(), tyres.MagicFormula):
        with pytest.raises(InputError, match="law = .*: must be a tyre, such as"):
            draw(other)


@pytest.mark.parametrize(("given", "words"), [
    ({"loads": []}, "loads are empty"), ({"loads": [4000.0, np.nan]}, "loads = nan: must be positive and finite"),
    ({"loads": -1.0}, "loads = -1.0: must be positive"), ({"speed": 0.0}, "speed = 0.0: must be positive"),
])  # fmt: skip
def test_loads_and_speed_of_a_tyre(given, words):
    with pytest.raises(InputError, match=words):
        plots.tyre(LAWS["MagicFormula"], **given)


def test_one_load_may_be_a_number():
    import matplotlib.pyplot as plt

    assert len(plots.tyre(LAWS["MagicFormula"], loads=4000.0).axes[0].lines) == 1
    plt.close("all")


ESTIMATES = {
    "estimate": plots.estimate, "innovations": plots.innovations,
    "closeup": lambda estimate: plots.closeup(estimate, Recording([0.0, 1.0], {"v_y": jnp.zeros(2)}), quantity_name="v_y"),
}  # fmt: skip


@pytest.mark.parametrize("draw", ESTIMATES.values(), ids=ESTIMATES)
def test_one_estimate(draw):
    run = {"v_y": jnp.zeros((3, 10))}
    with pytest.raises(
        InputError, match=r"estimate.time has shape \(3, 10\): must be \(T,\), one run. Take one of several"
    ):
        draw(types.SimpleNamespace(time=jnp.ones((3, 10)), mean=run, std=run, info=run))
    with pytest.raises(InputError, match="estimate = [0-9.]+: must have time, (mean and std|info)"):
        draw({"a": 1} if draw is plots.estimate else 1)


def test_one_car():
    for other in ("car", {}, tyres.Linear(1.0)):
        with pytest.raises(InputError, match="plots.car: vehicle = .*: must be a vehicle, or a car's file"):
            plots.car(other)


def test_a_single_name_is_not_its_letters():
    log = Recording(np.arange(3.0), {"yaw_rate": np.zeros(3), "a_y": np.zeros(3)})
    assert log.select("yaw_rate").names == ("yaw_rate",)
    with pytest.raises(InputError, match=r"unknown name\(s\) yaw_rte; there are"):
        plots.recording(log, "yaw_rte")
    with pytest.raises(InputError, match=r"unknown name\(s\) yaw_rte; there are"):
        log.select("yaw_rte")
