"""Uneven roads: the spectrum of ISO 8608 along any track, and how alike two tracks are."""

import dataclasses

import jax
import numpy as np
import pytest

from jaxveh import InputError, roads, simulate, vehicles
from jaxveh._core.names import record_type
from jaxveh.manoeuvres import step_steer

KEYS = jax.random.split(jax.random.key(2), 30)
STEP = 0.2


def tracks(roughness, across, **options):
    """Heights (30, T) of two tracks of 30 roads, every 0.2 m over 200 m."""
    s = np.arange(0.0, 200.0, STEP)
    one = lambda key, y: roads.rough(roughness, key, **options).at(s, y).height
    both = jax.jit(lambda keys: jax.vmap(lambda key: (one(key, 0.0), one(key, across)))(keys))(KEYS)
    return [np.asarray(track) for track in both]


def averaged(a, b, low, high):
    """The one-sided (cross-)density of two tracks between two wavenumbers, over all roads and wavenumbers in the band."""
    window = np.hanning(a.shape[1])
    scale = 2 * STEP / np.sum(window**2)
    first, second = (np.fft.rfft(window * (one - one.mean(1, keepdims=True))) for one in (a, b))
    n = np.fft.rfftfreq(a.shape[1], STEP)
    band = (n >= low) & (n < high)
    return scale * np.mean((np.conj(first) * second)[:, band]), np.exp(np.mean(np.log(n[band])))


@pytest.mark.parametrize("roughness", ["A", "C", 5e-5])
def test_the_density_is_that_of_its_class(roughness):
    left, right = tracks(roughness, 1.5)
    told = roads.ROUGHNESS.get(roughness, roughness)
    for track in (left, right):
        for low, high in ((0.05, 0.1), (0.1, 0.3), (0.5, 1.5)):
            found, middle = averaged(track, track, low, high)
            # Twenty to a hundred waves a band and thirty roads.
            np.testing.assert_allclose(found.real, told * (middle / 0.1) ** -2, rtol=0.35)


def test_tracks_are_alike_in_long_waves_and_not_in_short_ones():
    left, right = tracks("B", 1.5)
    for low, high in ((0.03, 0.06), (0.1, 0.15), (0.5, 1.5)):
        (cross, middle), (a, _), (b, _) = (
            averaged(*pair, low, high) for pair in ((left, right), (left, left), (right, right))
        )
        alike = cross.real / np.sqrt(a.real * b.real)
        np.testing.assert_allclose(alike, np.exp(-2 * np.pi * 0.6 * middle * 1.5), atol=0.12)


def test_without_slant_both_tracks_are_one():
    left, right = tracks("B", 1.5, slant=0.0)
    np.testing.assert_array_equal(left, right)


CAR = vehicles.named_car("passenger_car", "fourteen-dof")
WHEELS = ("fl", "fr", "rl", "rr")


def loads(ground):
    u = record_type("Inputs", CAR.inputs)(*[0.0] * len(CAR.inputs))
    _, shown = CAR.evaluate(0.0, CAR.start(0.0, u, v_x=20.0), u, ground)
    return np.array([float(getattr(shown, f"load_{at}")) for at in WHEELS])


@pytest.mark.parametrize("wheel", WHEELS)
def test_a_bump_under_a_wheel_compresses_its_tyre_alone(wheel):
    raised = loads(roads.Ground(**{f"height_{wheel}": 0.004})) - loads(roads.LEVEL)
    expected = np.array([0.004 * float(CAR.tyre_stiffness) * (at == wheel) for at in WHEELS])
    np.testing.assert_allclose(raised, expected, rtol=1e-3, atol=1e-6)


def test_heights_are_measured_from_the_origin_where_a_car_begins():
    assert [float(roads.rough("E", key).at(0.0, 0.0).height) for key in KEYS[:3]] == [0.0, 0.0, 0.0]


def test_each_wheel_stands_on_its_own_height():
    uneven = roads.rough("C", KEYS[0])
    ground = roads.under(uneven, 12.0, 0.3, 0.2, CAR.wheel_positions)
    for at, (forward, left) in zip(WHEELS, CAR.wheel_positions, strict=True):
        x, y = 12.0 + forward * np.cos(0.2) - left * np.sin(0.2), 0.3 + forward * np.sin(0.2) + left * np.cos(0.2)
        np.testing.assert_allclose(getattr(ground, f"height_{at}"), uneven.at(x, y).height, atol=1e-12)


@pytest.mark.full
def test_a_car_is_shaken_by_a_tenth_to_a_third_of_its_loads():
    drive = simulate(CAR, step_steer(20.0, 0.0, duration=6.0), road=roads.rough("C", KEYS[0]), dt=0.01)
    np.testing.assert_allclose(drive["true.z"][0], CAR.cg_height)
    for at, static in zip(WHEELS, loads(roads.LEVEL), strict=True):
        assert 0.08 < np.std(np.asarray(drive[f"true.load_{at}"])[100:]) / static < 0.4
    assert np.std(np.asarray(drive["true.roll"])) > 1e-4
    assert np.std(np.asarray(drive["true.height_fl"])) > 1e-3


def test_bad_input():
    with pytest.raises(InputError, match="roughness = 'F': must be one of"):
        roads.rough("F", KEYS[0])
    with pytest.raises(InputError, match="shortest = 100"):
        roads.rough("A", KEYS[0], shortest=100.0)
    made = roads.rough("A", KEYS[0])
    with pytest.raises(InputError, match=r"all must be \(n,\)"):
        dataclasses.replace(made, phases=made.phases[:3])
    with pytest.raises(InputError, match=r"Combined\.height"):
        roads.Combined(roads.Level(), roads.Level(), height=3.0)


def test_unevenness_lies_on_the_shape_of_another_road():
    uneven = roads.rough("B", KEYS[1])
    whole = roads.Combined(roads.Level(0.4), roads.Hill(3.0), height=uneven)
    here = whole.at(33.0, 0.7)
    np.testing.assert_array_equal(here.height, uneven.at(33.0, 0.7).height)
    np.testing.assert_array_equal(here.grade, roads.Hill(3.0).at(33.0, 0.7).grade)
    assert float(here.friction) == 0.4
