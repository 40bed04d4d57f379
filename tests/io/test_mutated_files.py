"""Every kind of text file that a stranger brings, spoilt at random: a finite object, or an `InputError`; never a traceback."""

import dataclasses
import warnings

import jax
import numpy as np
import pytest
from mutations import mutations
from test_commonroad_files import CAR as COMMONROAD
from test_commonroad_files import TYRE as COMMONROAD_TYRE
from test_tydex import PLAIN, ROWS
from test_tydex import text as tydex_text
from test_vbo import PLAIN as VBOX

from jaxveh import io, tyres
from jaxveh._core.errors import InputError
from jaxveh.io import car, channel_map, road

COUNT, MANY = 250, 5000
"""Mutations of each kind: in the default run and in the full one."""

LOG = "time,steer,v_x [km/h],a_y,gear\n" + "".join(
    f"{0.01 * k:.2f},{0.001 * k},{72 + k},{0.5 - 0.1 * k},\n" for k in range(12)
)
SEMICOLONS = "Time;Speed;Gierrate;note\n" + "".join(f"{k},5;{20 + k},25;-1,{k};ok\n" for k in range(8))
MAP = (
    'time = { column = "Time", unit = "ms" }\n[channels.yaw_rate]\ncolumn = "Gierrate"\nunit = "deg/s"\nsign = -1\n'
    'scale = 1.5\noffset = 0.1\n[channels]\nv_x = "Speed"\n[csv]\nseparator = ";"\ndecimal = ","\n'
)
RIG = "in_Fz,in_alpha [deg],in_kappa,gamma,in_Vx,P [bar],Fy,Mz,run\n" + "".join(
    f"{4000 + k},{k - 3},0.0{k},0.01,16.7,2.2,{-900 * k},{5 * k},{k // 4}\n" for k in range(8)
)
TYDEX = tydex_text(
    [*PLAIN, ("INCLANGL", "deg", 1, 0.5, 0.1)], [row + "  1.0" for row in ROWS], [("INFLPRES", "bar", 2.5)]
)
PARAMETERS = '[tyre]\nmodel = "Brush"\nslip_stiffness = 9e4\ncornering_stiffness = 60000.0 # N/rad\nslides = "against velocity"\n'


def read_log(path):
    recording = io.read_recording(path)
    return log_numbers(recording)


def log_numbers(recording):
    """Time, which rises. Channels are what their cells say: a recording may hold gaps and, of a simulation, infinities."""
    time = np.asarray(recording.time)
    assert (np.diff(time) > 0).all()
    assert all(np.asarray(values).dtype == np.float64 for values in recording.channels.values())
    return [time]


def read_log_by_map(path):
    """A good map and a log that may be spoilt."""
    good = path.with_name("good_map.toml")
    good.write_text(MAP)
    return log_numbers(io.read_recording(path, good))


def read_rig(path):
    table = io.read_rig_table(path)
    measured = [
        np.nan_to_num(v, nan=0.0, posinf=np.inf, neginf=-np.inf)
        for v in (table.F_x, table.F_y, table.M_z)
        if v is not None
    ]
    return [table.slip_angle, table.slip_ratio, table.load, *measured]


def read_commonroad_pair(path):
    tyre = path.with_name("tyre.yaml")
    tyre.write_text(COMMONROAD_TYRE)
    return read_commonroad(path, tyre)


def read_commonroad(path, tyre=None):
    pytest.importorskip("yaml")
    return io.read_commonroad(path, tyre)


KINDS = {
    "car": (io.read_car, "toml", [car.CAR_SCHEMA, car.CAR_SCHEMA[: car.CAR_SCHEMA.index("# All that")]]),
    "road": (io.read_road, "toml", [road.ROAD_SCHEMA, "friction = 0.5\n"]),
    "channel map": (io.read_channel_map, "toml", [channel_map.CHANNEL_MAP_SCHEMA, MAP]),
    "tyre parameters": (tyres.read_parameters, "toml", [PARAMETERS]),
    "log": (read_log, "csv", [LOG, LOG.replace("\n", "\r\n"), LOG.replace(",", "\t")]),
    "log of a VBOX": (read_log, "vbo", [VBOX, VBOX.replace("velocity", "lat")]),
    "log by map": (read_log_by_map, "csv", [SEMICOLONS]),
    "rig table": (read_rig, "csv", [RIG, RIG.replace(",", ";")]),
    "TYDEX": (read_rig, "tdx", [TYDEX]),
    "CommonRoad": (read_commonroad, "yaml", [COMMONROAD, COMMONROAD + COMMONROAD_TYRE]),
    "CommonRoad, two files": (read_commonroad_pair, "yaml", [COMMONROAD]),
}


def numbers(found):
    """All numbers of an object: of its fields, and of theirs."""
    if dataclasses.is_dataclass(found):
        return [one for field in dataclasses.fields(found) for one in numbers(getattr(found, field.name))]
    if isinstance(found, dict):
        return [one for value in found.values() for one in numbers(value)]
    if isinstance(found, tuple | list):
        return [one for value in found for one in numbers(value)]
    return [] if found is None or isinstance(found, str) else jax.tree.leaves(found)


def check_outcomes(kind, count, seed, folder):
    read, suffix, originals = KINDS[kind]
    originals = [text.encode() for text in originals]
    path, accepted = folder / f"odd.{suffix}", 0
    for data in originals:
        path.write_bytes(data)
        assert numbers(read(path))
    for k, data in enumerate(mutations(seed, originals, count)):
        path.write_bytes(data)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = read(path)
        except InputError:
            continue
        accepted += 1
        assert all(np.isfinite(one).all() for one in numbers(found)), k
    assert 0 < accepted < count


@pytest.mark.parametrize("kind", KINDS)
def test_a_finite_object_or_an_error(kind, tmp_path):
    check_outcomes(kind, COUNT, 1, tmp_path)


@pytest.mark.full
@pytest.mark.parametrize("kind", KINDS)
def test_a_finite_object_or_an_error_many_times(kind, tmp_path):
    check_outcomes(kind, MANY, 2, tmp_path)
