"""`estimators.Exchange`: methods that read what others say."""

import jax
import jax.numpy as jnp
import method_logs
import numpy as np
import pytest

from jaxveh import InputError, Recording, estimators
from jaxveh.estimators import AbstractMethod, Exchange, kit

SPEED = estimators.speed.METHODS["weighted"].make(method_logs.CAR)
SIDESLIP = estimators.sideslip.METHODS["steady_steer"].make(method_logs.CAR)
WHOLE = Exchange({"speed": SPEED, "sideslip": SIDESLIP}, gives={"v_x": "speed.v_x"})


class Sum(AbstractMethod):
    """What it heard of this row, and a share of what it said of the last."""

    share: jax.Array
    reads: str

    @property
    def needs(self):
        return (kit.Need("a", "-", optional=True), kit.Need(self.reads, "-"))

    def first(self, t, values):
        return self.next(jnp.zeros_like(t), t, values)

    def next(self, memory, t, values):
        heard = jnp.where(jnp.isnan(values[self.reads]), 0.0, values[self.reads])
        said = self.share * memory + heard + values["a"]
        return said, kit.answer({"sum": said})


def test_what_is_handed_on_is_read_as_a_channel_of_the_same_row():
    log = method_logs.log((*SPEED.needs, *SIDESLIP.needs))
    channels = {need.channel for need in WHOLE.needs}
    assert "v_x" not in channels and {"steer", "wheel_speed_fl"} <= channels
    found = kit.follow("whole", WHOLE, log.without("v_x"))
    speed = kit.follow("speed", SPEED, log)
    alone = kit.follow("sideslip", SIDESLIP, log.replace(v_x=np.asarray(speed["v_x"])))
    np.testing.assert_allclose(found["speed_v_x"], speed["v_x"], rtol=1e-12)
    np.testing.assert_allclose(found["sideslip_sideslip"], alone["sideslip"], rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(found.known.sideslip_sideslip, alone.known.sideslip)
    live = estimators.LiveMethod(WHOLE)
    memory = None
    for k in range(5):
        row = {need.channel: np.asarray(log[need.channel])[k] for need in WHOLE.needs}
        memory, said = live.init(log.time[k], row) if k == 0 else live.step(memory, log.time[k], row)
        np.testing.assert_allclose(said.mean.sideslip_sideslip, found["sideslip_sideslip"][k], rtol=1e-9, atol=1e-12)


def test_two_may_read_each_other_and_the_first_hears_the_row_before():
    half, third = Sum(jnp.asarray(0.5), "b"), Sum(jnp.asarray(1.0 / 3.0), "c")
    both = Exchange({"half": half, "third": third}, gives={"b": "third.sum", "c": "half.sum"})
    assert [need.channel for need in both.needs] == ["a"] and both.needs[0].optional
    rows = np.array([1.0, 2.0, 0.5, -1.0])
    found = kit.follow("both", both, Recording(np.arange(4.0), {"a": rows}))
    x = y = 0.0
    for k, a in enumerate(rows):
        x = 0.5 * x + y + a
        y = y / 3.0 + x + a
        np.testing.assert_allclose([found["half_sum"][k], found["third_sum"][k]], [x, y], rtol=1e-12)


def test_gradients_pass_from_one_to_the_other():
    values = {"a": jnp.array([1.0, 2.0, 0.5, -1.0])}
    time = jnp.arange(4.0)

    def last(share):
        both = Exchange({"one": Sum(share, "b"), "two": Sum(share, "c")}, gives={"b": "two.sum", "c": "one.sum"})
        return kit.follow_rows(both, time, values).mean.two_sum[-1]

    here, by = jnp.asarray(0.4), 1e-5
    np.testing.assert_allclose(jax.grad(last)(here), (last(here + by) - last(here - by)) / (2.0 * by), rtol=1e-6)


def test_what_does_not_go_together_is_said():
    with pytest.raises(InputError, match="methods is empty"):
        Exchange({}, {})
    with pytest.raises(InputError, match=r"methods\['speed'\] = [0-9]+"):
        Exchange({"speed": 1}, {})
    with pytest.raises(InputError, match=r"gives\['v_x'\] = grade.v_x: must begin with one of speed, sideslip"):
        Exchange({"speed": SPEED, "sideslip": SIDESLIP}, {"v_x": "grade.v_x"})
    with pytest.raises(InputError, match=r"gives\['mass'\]: no method reads it"):
        Exchange({"speed": SPEED, "sideslip": SIDESLIP}, {"mass": "speed.v_x"})
    wrong = Exchange({"speed": SPEED, "sideslip": SIDESLIP}, {"v_x": "speed.v_y"})
    with pytest.raises(InputError, match="speed.v_y: the method reports v_x"):
        kit.follow("wrong", wrong, method_logs.log(wrong.needs))
