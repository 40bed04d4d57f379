"""Axes of a sweep's figures are in words and have a unit, whatever a study varies and measures."""

import re

import numpy as np
import pytest

from jaxveh import sweeps, tyres, vehicles
from jaxveh._core.parameter import every_parameter
from jaxveh.studies import words
from jaxveh.studies.axes import field_of
from jaxveh.studies.metrics import METRICS
from jaxveh.studies.settings import DEFAULTS

KEY = re.compile(r"[a-z0-9]_[A-Za-z]|\w\.\w")
"""What looks like a name in a program: words joined by an underscore or a dot; `F_x` and `M_z` are symbols."""


def paths():
    """What can be varied: numbers of cars and devices, noises, the drive."""
    for fidelity in ("single-track", "seven-dof", "roll-4dof"):
        for name in every_parameter(vehicles.named_car("sedan", fidelity)):
            yield f"car.{name}"
            yield f"told.{name}"
    for table in ("sensors", "process_noise", "measurement_noise"):
        yield from (f"{table}.{name}" for name in ("a_y", "yaw_rate"))
    yield from (f"car.{axle}.scaling.{code}" for axle in ("front", "rear") for code in words.SCALING)
    yield from ("drive.speed", "drive.steer_deg", "drive.road", "filter.particles", "estimator.fidelity")


def test_every_scaling_factor_of_a_tyre_has_words():
    assert set(words.SCALING) == set(tyres.typical_mf_tyre(4000.0).scaling.__dataclass_fields__)


def test_every_table_of_a_study_has_words():
    varied = set(DEFAULTS) - {"channels", "metrics"}
    assert {f"{table}_" for table in varied} | {"samples."} == set(words.TABLES)


def test_an_axis_is_in_words():
    for path in paths():
        for name in (field_of(path), f"samples.{field_of(path)}"):
            found = sweeps.Swept(sweeps.Design(x=[1.0, 2.0]), 1, {name: np.ones((2, 1))}, {name: "kg"})
            label = words.shown_on_figure(found, name).label
            assert label.endswith(" [kg]") and not KEY.search(label.removesuffix(" [kg]")), label


@pytest.mark.parametrize("metric", METRICS)
def test_a_value_is_in_words(metric):
    for quantity in ("sideslip", "v_y", "front_D") if METRICS[metric].of_quantity else ("",):
        said = words.words_for(f"{metric}.{quantity}".rstrip("."))
        assert not KEY.search(said) and said, said


def test_a_value_of_one_s_own_stays_as_it_is():
    assert words.words_for("x") == "x" and words.words_for("parameters.front.B") == "parameters.front.B"
