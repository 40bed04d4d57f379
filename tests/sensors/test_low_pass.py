"""The low-pass: transfer function, exact steps, settled start, delay, recordings."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Recording
from jaxveh.sensors import LowPass, low_pass
from jaxveh.statespace import RK4


def response(device, frequency):
    """Transfer function at a frequency in Hz, from the state-space form that `derivatives` gives."""
    n = device.order
    rates = lambda z: jnp.stack(device.derivatives(tuple(z[:n]), z[n]))
    jacobian = np.asarray(jax.jacfwd(rates)(jnp.zeros(n + 1)))
    s = 2j * np.pi * frequency
    return np.linalg.solve(s * np.eye(n) - jacobian[:, :n], jacobian[:, n])[0]


@pytest.mark.parametrize("order", [1, 2])
def test_magnitude_is_butterworths(order):
    device = LowPass(20.0, order)
    for frequency in (0.1, 5.0, 20.0, 60.0):
        expected = 1 / np.sqrt(1 + (frequency / 20.0) ** (2 * order))
        np.testing.assert_allclose(abs(response(device, frequency)), expected, rtol=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_delay_is_the_group_delay_at_low_frequency(order):
    device = LowPass(20.0, order)
    np.testing.assert_allclose(-np.angle(response(device, 1e-3)) / (2e-3 * np.pi), device.delay, rtol=1e-6)


@pytest.mark.parametrize("order", [1, 2])
def test_a_step_is_exact_for_a_linear_input(order):
    device, dt, u0, u1 = LowPass(20.0, order), 0.013, 0.4, -0.3
    start = (jnp.asarray(0.9), jnp.asarray(-5.0))[:order]
    term = diffrax.ODETerm(lambda t, x, args: device.derivatives(x, u0 + (u1 - u0) * t / dt))

    def fine(x, k):
        return RK4().step(term, k * dt / 400, (k + 1) * dt / 400, x, None, None, False)[0], None

    expected, _ = jax.lax.scan(fine, start, jnp.arange(400.0))
    np.testing.assert_allclose(device.step(start, u0, u1, dt), expected, rtol=1e-10)


@pytest.mark.parametrize("order", [1, 2])
def test_a_constant_input_stays_settled(order):
    device = LowPass(20.0, order)
    settled = device.start(jnp.asarray(3.0))
    np.testing.assert_allclose(device.derivatives(settled, 3.0), 0.0, atol=1e-12)
    np.testing.assert_allclose(device.step(settled, 3.0, 3.0, 0.01), settled, atol=1e-12)
    assert device.state_names("a_y") == ("a_y_filtered", "a_y_filtered_rate")[:order]


def drive():
    time = np.cumsum(np.where(np.arange(400) % 7 == 0, 0.02, 0.01))
    return Recording(time, {"steer": 0.3 * time, "v_x": 20 + np.sin(2 * np.pi * 3 * time)}, {"steer": "rad"})


def test_a_ramp_comes_out_late_by_the_delay_whatever_the_steps():
    recording = drive()
    out = low_pass(recording, ["steer"], 20.0)
    settled = slice(100, None)
    late = recording.time - float(LowPass(20.0).delay)
    np.testing.assert_allclose(out["steer"][settled], 0.3 * late[settled], rtol=1e-10)
    np.testing.assert_array_equal(out["v_x"], recording["v_x"])
    assert out.unit("steer") == "rad"


def test_a_sine_comes_out_with_the_filters_magnitude_and_phase():
    recording = drive()
    out = np.asarray(low_pass(recording, "v_x", 20.0)["v_x"]) - 20
    gain = response(LowPass(20.0), 3.0)
    expected = np.imag(gain * np.exp(2j * np.pi * 3 * recording.time))
    np.testing.assert_allclose(out[100:], expected[100:], atol=0.02)  # the sine is linear between rows


def test_float32_recordings_stay_float32():
    recording = Recording(drive().time, {"steer": jnp.asarray(drive()["steer"], np.float32)})
    out = low_pass(recording, "steer")["steer"]
    assert out.dtype == np.float32
    np.testing.assert_allclose(out, low_pass(drive(), "steer")["steer"], atol=1e-5)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: LowPass(0.0), r"LowPass\.cutoff_hz = 0\.0: must be positive"),
        (lambda: LowPass(20.0, 3), r"LowPass\.order = 3: must be one of 1, 2"),
        (lambda: low_pass(drive(), ["speed"]), r"low_pass: unknown name\(s\) speed"),
        (lambda: low_pass(drive().replace(steer=np.full(400, np.nan)), "steer"), r"steer = nan at t = .*Fill it first"),
    ],
)
def test_bad_input_raises_by_name_value_and_range(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_it_passes_20_hz_unless_told():
    plain = low_pass(drive(), "steer")["steer"]
    np.testing.assert_array_equal(plain, low_pass(drive(), "steer", 20.0, order=2)["steer"])
    assert np.max(np.abs(plain - low_pass(drive(), "steer", 21.0)["steer"])) > 1e-6
