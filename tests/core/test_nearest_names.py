"""Whoever mistypes a name is told the nearest: derived from every place that knows names."""

import numpy as np
import pytest

from jaxveh import InputError, Recording, estimators, filters, manoeuvres, roads, sensors, statespace, tyres, vehicles
from jaxveh._core.errors import check_one_of, did_you_mean
from jaxveh._core.names import check_names

LOG = Recording(np.arange(3.0), {"steer": np.zeros(3), "yaw_rate": np.zeros(3)})
ASKED = {
    "channel": (lambda: LOG["yawrate"], "yaw_rate"),
    "channels": (lambda: LOG.select(["ster"]), "steer"),
    "car": (lambda: vehicles.named_car("sedann", "single-track"), "sedan"),
    "fidelity": (lambda: vehicles.named_car("sedan", "single-trak"), "single-track"),
    "devices": (lambda: sensors.named_devices("produktion", None), "production"),
    "method": (lambda: estimators.speed.estimate(None, LOG, method="slip_awere"), "slip_aware"),
    "considered state": (lambda: filters.Consider(filters.Unscented(), ("v_yy",)).check(model()), "v_y"),
    "rule": (lambda: filters.Guided(10, rule="unsented"), "unscented"),
    "road": (lambda: roads.named_road("unevn"), "uneven"),
    "manoeuvre": (lambda: manoeuvres.named_manoeuvre("step-ster", 20.0), "step-steer"),
    "option": (lambda: manoeuvres.named_manoeuvre("step-steer", 20.0, duratoin=3.0), "duration"),
    "start": (lambda: statespace.start_from(model(), v_yy=1.0), "v_y"),
    "fill": (lambda: LOG.fill("steer", "linaer"), "linear"),
}


def model():
    car = vehicles.passenger_car()
    return estimators.state_space(car, sensors.esc(yaw_rate=0.01, a_y=0.1))


@pytest.mark.parametrize("what", ASKED)
def test_the_nearest_name_is_proposed(what):
    ask, meant = ASKED[what]
    with pytest.raises(InputError, match=rf"(?i)did you mean '?{meant}'?\?"):
        ask()


def test_what_looks_like_nothing_is_not_guessed():
    with pytest.raises(InputError) as caught:
        check_one_of("filter", "zzz", ("ukf", "pf"))
    assert "Did you mean" not in str(caught.value) and "'ukf', 'pf'" in str(caught.value)
    assert did_you_mean([3, "UKF"], ("ukf", 4)) == " Did you mean ukf?"
    with pytest.raises(InputError, match="there are: none.$"):
        check_names("log", ["steer"], ())


@pytest.mark.parametrize("room", [tyres, vehicles, filters, sensors])
def test_every_name_of_a_room_is_found_with_a_letter_missing(room):
    for name in room.__all__:
        if len(name) > 6:
            assert did_you_mean([name[:3] + name[4:]], room.__all__).startswith(" Did you mean ")
