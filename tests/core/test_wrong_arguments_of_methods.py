"""What the methods of recordings and of live estimators are given by mistake is named, as in `test_wrong_arguments`."""

import inspect

import equinox as eqx
import numpy as np
import pytest
from families import arguments_of, refuses

from jaxveh import InputError, Recording, estimators, filters, io, sensors, vehicles

T = np.arange(8) / 10
DRIVE = Recording(T, {"steer": 0.02 + 0 * T, "v_x": 20.0 + 0 * T, "yaw_rate": 0.1 * T, "a_y": 2.0 * T})
ROW = {name: float(DRIVE[name][0]) for name in DRIVE.names}
MODEL = estimators.state_space(vehicles.passenger_car(), sensors.esc(yaw_rate=0.005, a_y=0.1))
FILE = io.CarSpecification(
    mass=1500.0, yaw_inertia=2500.0, front_axle_to_cg=1.2, rear_axle_to_cg=1.4, front_cornering_stiffness=8e4,
    rear_cornering_stiffness=9e4,
)  # fmt: skip
LIVE = estimators.Live(filters.Extended(), MODEL, estimators.kit.AsItIs())
METHOD = estimators.LiveMethod(estimators.sideslip.METHODS["open_loop"].make(FILE))
BELIEF, MEMORY = LIVE.init(0.0, ROW)[0], METHOD.init(0.0, ROW)[0]

RIGHT = {
    "names": ("a_y",), "start": 0.1, "end": 0.5, "which": slice(0, 3), "channel": "a_y", "t": 0.1, "channels": ROW,
    "belief": BELIEF, "memory": MEMORY,
}  # fmt: skip
TAKEN = {
    ("rows", "which"): ("none",), ("replace", "units"): ("a mapping",), ("replace", "source"): ("text",),
    ("init", "channels"): ("a mapping",), ("step", "channels"): ("a mapping",),
}  # fmt: skip
"""What is wrong for others; channels that are missing from a mapping are named."""
ELSEWHERE = {"from_pandas", "to_pandas", "from_xarray", "to_xarray", "save", "load", "plot", "without", "unit"}
"""Files, frames and plots, which other tests look at, and names of any kind."""

METHODS = {
    f"{type(one).__name__}.{name}": getattr(one, name)
    for one in (DRIVE, LIVE, METHOD)
    for name in dir(type(one))
    if not name.startswith("_") and name not in ELSEWHERE and inspect.isfunction(getattr(type(one), name))
}


@pytest.mark.parametrize("name", METHODS)
def test_what_is_wrong_for_an_argument_is_named(name):
    made, method = METHODS[name], name.split(".")[1]
    given = {one.name: RIGHT[one.name] for one in arguments_of(made) if one.default is one.empty}
    made(**given)
    for argument in arguments_of(made):
        if argument.name != "memory":
            said = {"channel": "unknown name", "names": "unknown name"}.get(argument.name, "")
            refuses(made, given, argument, said, TAKEN.get((method, argument.name), ()))


@pytest.mark.parametrize("live", [LIVE, METHOD])
def test_a_number_of_a_row_that_is_none_is_named(live):
    for wrong in ("eight", [1.0, "one"], object(), 1j):
        with pytest.raises(InputError, match="row: v_x = .* must be a real number"):
            live.init(0.0, ROW | {"v_x": wrong})
    for wrong in (np.nan, np.inf):
        with pytest.raises(InputError, match=f"row: t = {wrong}: must be finite"):
            live.init(wrong, ROW)
    first, missing = live.init(0.0, ROW | {"v_x": None}), live.init(0.0, ROW | {"v_x": np.nan})
    assert eqx.tree_equal(first, missing) or str(first) == str(missing)


def test_frames_and_their_rows_are_mappings():
    frame = DRIVE.to_pandas().drop(columns="time", errors="ignore")
    again = Recording(T, frame)
    assert again.names == DRIVE.names
    for live in (LIVE, METHOD):
        of_row, of_dict = (live.init(0.0, row)[1].mean for row in (frame.iloc[0], ROW))
        assert eqx.tree_equal(of_row, of_dict)


def test_gaps_are_filled_up_to_a_length():
    gappy = DRIVE.replace(a_y=np.where(T == 0.2, np.nan, T))
    for wrong in (-1.0, 0.0, np.nan):
        with pytest.raises(InputError, match="max_gap = .*: must be positive"):
            gappy.fill("a_y", max_gap=wrong)
    assert np.isnan(gappy.fill("a_y", max_gap=0.1)["a_y"]).sum() == 1
    assert np.isnan(gappy.fill("a_y", max_gap=np.inf)["a_y"]).sum() == 0
