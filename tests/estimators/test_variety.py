"""How varied a drive is, and how much less a monotonous one counts in a calibration."""

import functools

import numpy as np
import pytest
import test_sideslip

from jaxveh import Recording, estimators, filters, vehicles
from jaxveh.estimators import coarse_log, rear_axle_fit
from jaxveh.estimators.rear_axle import CHANNEL
from jaxveh.estimators.rear_axle_fit import MOST, VARIED, doubt
from jaxveh.estimators.variety import COLOUR, QUIET, variety

ROWS, STEP = 300, 1 / 3


def coarse(a_y, counted=None):
    """Rows as those of `coarse_logs`, as far as `variety` reads them."""
    a_y = np.asarray(a_y, float)
    there = np.ones(len(a_y), bool) if counted is None else counted
    return Recording(STEP * np.arange(len(a_y)), {"a_y_smooth": a_y, CHANNEL: np.where(there, 0.0, np.nan)})


def cosines(orders, size=20.0):
    """Cosines of whole numbers of half waves, which count equally."""
    place = (np.arange(ROWS) + 0.5) / ROWS
    return sum(size * order ** (-COLOUR / 2) * np.cos(np.pi * order * place) for order in orders)


@pytest.mark.parametrize("seed", range(5))
def test_equal_cosines_are_counted(seed):
    rng = np.random.default_rng(seed)
    orders = rng.choice(np.arange(1, 60), rng.integers(1, 12), replace=False)
    # What counts as quiet is taken from each.
    assert variety([coarse(cosines(orders, 200.0))]) == pytest.approx(len(orders), rel=0.01)
    assert variety([coarse(3.0 + cosines(orders, 200.0))]) == pytest.approx(len(orders), rel=0.01)


def test_logs_add_and_rows_that_do_not_count_are_left_out():
    one, other = cosines([3, 8]), cosines([5, 21, 30])
    both = [variety([coarse(a_y)]) for a_y in (one, other)]
    assert variety([coarse(one), coarse(other)]) == pytest.approx(sum(both))
    more = np.concatenate([one, np.random.default_rng(0).normal(size=80)])
    assert variety([coarse(more, np.arange(len(more)) < ROWS)]) == pytest.approx(both[0])
    assert variety([coarse(one), coarse(other, np.zeros(ROWS, bool))]) == pytest.approx(both[0])


def test_standing_still_or_noise_alone_has_none():
    assert variety([coarse(np.zeros(ROWS))]) == 0.0
    noise = np.random.default_rng(1).normal(scale=0.3 * QUIET, size=ROWS)
    assert variety([coarse(noise)]) < 1.5


@pytest.mark.parametrize("noise", [0.0, 0.03])
@pytest.mark.parametrize(
    ("drive", "few"),
    [("ramp", True), ("circle", True), ("sine", True), ("step", False), ("swept sine", False), ("random", False)],
)
def test_what_has_few_frequencies_is_told_from_what_has_many(drive, few, noise):
    t, rng = STEP * np.arange(90), np.random.default_rng(2)
    smooth = lambda values: np.convolve(values, np.ones(3) / 3, mode="same")
    a_y = {
        "ramp": 6.0 * np.clip((t - 3) / 20, 0, 1), "circle": 6.0 * (t / t[-1]) ** 2, "sine": 4.0 * np.sin(2 * np.pi * 0.3 * t),
        "step": 4.0 * (t > 10), "swept sine": 3.0 * np.sin(2 * np.pi * (0.05 + 0.02 * t) * t),
        "random": 3.0 * smooth(rng.normal(size=len(t))),
    }[drive]  # fmt: skip
    found = variety([coarse(a_y + rng.normal(scale=noise, size=len(t)))])
    assert found < 0.7 * VARIED if few else found > 1.5 * VARIED


def test_less_variety_counts_less_within_bounds():
    told = [doubt(varied) for varied in (0.0, 0.5, 1.5, 3.0, VARIED - 1e-9, VARIED, 50.0)]
    assert told == sorted(told, reverse=True)
    assert told[0] == MOST
    assert told[3] == pytest.approx(8.0)
    assert told[-2:] == [1.0, 1.0]


@functools.cache
def slalom():
    """A car that leans, at one frequency: its a_y is 15 % larger than the file's, and comes 8 ms late."""
    time, rng = np.arange(2400) * 0.01, np.random.default_rng(4)
    v_x, steer = np.full(len(time), 20.0), 0.03 * np.sin(2 * np.pi * 0.5 * time)
    truth = estimators.open_loop(
        vehicles.from_specification(test_sideslip.CAR), Recording(time, {"steer": steer, "v_x": v_x})
    )
    a_y = np.interp(time - 0.008, time, np.gradient(truth["v_y"], time) + v_x * truth["yaw_rate"])
    return Recording(
        time,
        {"v_x": v_x, "a_x": 0.0 * time, "yaw_rate": truth["yaw_rate"] + 0.002 * rng.normal(size=len(time)),
         "a_y": 1.15 * a_y + 0.1 * rng.normal(size=len(time))},
    )  # fmt: skip


def test_one_frequency_leaves_the_stiffness_twice_as_uncertain(monkeypatch):
    def left():
        found = estimators.sideslip.calibrate(test_sideslip.CAR, slalom())
        return float(found.fit.parameters_std["stiffness"] / found.model.system.stiffness)

    less = left()
    monkeypatch.setattr(rear_axle_fit, "VARIED", 0.0)
    assert less > 1.5 * left()


def test_a_reference_counts_whole(monkeypatch):
    monkeypatch.setattr(rear_axle_fit, "variety", lambda logs: pytest.fail("asked"))
    monkeypatch.setattr(rear_axle_fit, "_best", lambda *rest: (_ for _ in ()).throw(InterruptedError))
    log = coarse_log.coarse(slalom(), test_sideslip.CAR.wheelbase)
    model = estimators.sideslip.model(test_sideslip.CAR)
    fit = lambda reference: rear_axle_fit.fit_rear_axle(filters.Extended(), model, [log], reference, halves=False)
    with pytest.raises(InterruptedError):
        fit(rear_axle_fit.Reference([np.zeros(len(log))], 0.05))
    with pytest.raises(pytest.fail.Exception, match="asked"):
        fit(None)
