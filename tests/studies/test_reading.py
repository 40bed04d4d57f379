"""A study's file: the schema reads as it is; what is wrong is named with what there is."""

import copy
import functools
import random
import re

import pytest
from small_studies import DRIVE

from jaxveh import InputError, studies

CAR = "mass = 1420.0\nyaw_inertia = 2124.0\nfront_axle_to_cg = 0.96\nrear_axle_to_cg = 1.59\n"
STIFF = "front_cornering_stiffness = 88000.0\nrear_cornering_stiffness = 127000.0\n"


def read(folder, text):
    path = folder / "study.toml"
    path.write_text(text)
    return studies.read_study(path)


def test_the_schema_reads_as_it_is(tmp_path):
    study = read(tmp_path, studies.STUDY_SCHEMA)
    assert study.design.shape == (2, 3, 2, 8)
    assert study.size == 2 * 3 * 2 * 8 * 20
    words = study.words()
    for part in ("car.mass", "car.rear.scaling.LKY", "told.yaw_inertia", "the sensors' noise as it is"):
        assert part in words


def test_an_empty_study_is_one_point(tmp_path):
    study = read(tmp_path, "seed = 0")
    assert study.size == 20 and study.design.shape == ()


def test_a_cars_file_is_read_from_the_studys_folder(tmp_path):
    (tmp_path / "cars").mkdir()
    (tmp_path / "cars" / "own.toml").write_text(CAR + STIFF)
    study = read(tmp_path, '[vary]\n"drive.vehicle" = ["cars/own.toml", "sedan"]\n')
    axis = study.design.axis("drive_vehicle")
    assert axis.labels == ("cars/own.toml", "sedan")
    assert axis.values[0].mass == 1420.0 and axis.values[1] == "sedan"


def test_a_roads_file_is_found_from_the_studys_folder(tmp_path):
    (tmp_path / "hill.toml").write_text("distance = [0.0, 100.0]\ngrade = [0.0, 0.02]\nfriction = 1.0\nbank = 0.0\n")
    study = read(tmp_path, '[drive]\nroad = "hill.toml"\n[vary]\n"drive.road" = ["hill.toml", "wet"]\n')
    assert study.settings["drive"]["road"] == str(tmp_path / "hill.toml")
    assert study.design.axis("drive_road").values == (str(tmp_path / "hill.toml"), "wet")
    assert study.design.axis("drive_road").labels == ("hill.toml", "wet")


BAD = {
    "seed = 1\n[drives]\n": "no table 'drives' (did you mean 'drive'?)",
    "seeds = 0": "seeds = 0: must be a whole number from 1 to 10000000",
    "seed = -1": "seed = -1",
    'drive = "fast"': "drive = 'fast': must be a table",
    '[drive]\nvehicle = "sedam"': "no car 'sedam' (did you mean 'sedan'?)",
    '[drive]\nvehicle = "none.toml"': "none.toml",
    '[drive]\nmanoeuvre = "slaalom"': "no manoeuvre 'slaalom' (did you mean 'slalom'?)",
    '[drive]\nfidelity = "twotrack"': "no fidelity 'twotrack'",
    "[drive]\nspede = 20.0": "no key 'spede' (did you mean 'speed'?)",
    "[drive]\nspeed = -20.0": "speed = -20.0",
    "[drive]\nsteer_deg = 120.0": "drive.steer_deg = 120.0: must be between -90 and 90 degrees",
    "[drive]\nrate = 0.0": "drive.rate = 0.0: must be positive",
    '[drive]\nroad = "mud"': "road = 'mud'",
    "[car]\nmas = 1.0": "no number of SingleTrack 'mas' (did you mean 'mass'?)",
    "[car]\nmass = -1.0": "car.mass = -1.0: must be positive",
    "[told]\nfront.Q = 1.0": "no number of SingleTrack 'front.Q'",
    '[sensors]\ndevices = "radar"': "sensors.devices = 'radar': must be one of",
    "[sensors]\nyaw_rate = -1.0": "-1.0",
    '[sensors]\ndevices = "none"\nyaw_rate = 0.1': "devices that measure nothing",
    '[sensors]\ndevices = "production"': "[measurement_noise]",
    "[process_noise]\nspin = 1.0": "spin",
    'estimator = "sideslipp"': "no estimator 'sideslipp' (did you mean 'sideslip'?)",
    '[estimator]\nname = "sideslip"\nfidelity = "linear"': "no key 'fidelity'",
    '[estimator]\nname = "state-space"\nestimate = ["front.Q"]': "no number of SingleTrack 'front.Q'",
    'filter = "kalmann"': "no filter 'kalmann' (did you mean 'kalman'?)",
    'filter = "kalman"': "linear",
    "[filter]\nparticles = 3": "filter extended: no option 'particles'",
    '[filter]\nname = "particle-filter"': "needs particles",
    '[filter]\nname = "extended"\nparticles = 3': "no option 'particles'",
    '[filter]\nname = "gated"\ninner = "extendet"': "no filter 'extendet'",
    '[filter]\nname = "unscented"\nform = "square"': "no form 'square'",
    "[metrics]\nafter = -1.0": "metrics.after = -1.0: must be from 0 to below the duration, 7 s",
    "[metrics]\nafter = 7.0": "metrics.after = 7.0: must be from 0 to below the duration, 7 s",
    '[metrics]\nafter = "late"': "metrics.after = 'late': must be a finite number",
    "[metrics]\nnames = []": "metrics.names = []: must be a list of names",
    '[metrics]\nnames = ["rmse"]': "rmse is of a quantity",
    '[metrics]\nnames = ["nis.v_y"]': "nis is of the whole run",
    '[metrics]\nnames = ["rmsd.v_y"]': "no metric 'rmsd' (did you mean 'rmse'?)",
    "[metrics]\nbefore = 1.0": "no key 'before'",
    '[vary]\n"drive.speed" = 20.0': "vary.drive.speed = 20.0: must be a list",
    '[vary]\n"drive.speed" = []': "must be a list",
    '[vary]\n"drive.speed" = ["fast"]': "vary.drive.speed = 'fast': must be a finite number",
    '[vary]\n"drive.speed" = [20.0, -20.0]': "speed = -20.0",
    '[vary]\n"drive.steer_deg" = [1.0, 120.0]': "steer",
    '[vary]\n"car.mass" = {from = 1.0, to = -1.0}': "car.mass = -1.0",
    '[vary]\n"car.mass" = {from = 1.0, to = 2.0, count = 1}': "count = 1",
    '[vary]\n"car.mass" = {from = 0.0, to = 2.0, scale = "log"}': "a logarithmic range must be positive",
    '[vary]\n"car.mass" = {from = 1.0, to = 2.0, steps = 3}': "no key 'steps'",
    '[vary]\n"drive.manoeuvre" = ["slalom", "slalom"]': "has a value twice",
    '[vary]\n"drive.speed" = [15.0, 20, 15]': "vary.drive.speed = [15.0, 20, 15]: has a value twice",
    '[vary]\n"car.mass" = {from = 1400.0, to = 1400.0, count = 3}': "has a value twice",
    '[vary]\n"drive.speed" = [20.0, 1e6]': "drive.speed = 1000000.0: must be between 0 and 150 m/s",
    "seed = 99999999999999999999": "seed = 99999999999999999999: must be a whole number from 0 to 9223372036854775807",
    '[vary.samples]\nseed = 9223372036854775808\nranges = {"car.mass" = [1.0, 2.0]}': "a whole number from 0 to 922",
    '[vary]\n"car.mass" = [1.0]\ncar.mass = [2.0]': "car_mass is there twice",
    "[vary]\nfilter = 3": "must be a list of names, or a table of labels",
    '[vary]\nfilter = ["extended", "no"]': "no filter 'no'",
    "[vary.samples]\ncount = 3\nranges = {\"car.mass\" = [1.0, 2.0]}": "powers of two",
    "[vary.samples]\ncount = 4\nranges = {\"drive.rate\" = [1.0, 2.0]}": "cannot vary within one program",
    "[vary.samples]\ncount = 4\nranges = {\"car.mass\" = [2.0, 1.0]}": "must be (low, high)",
    "[vary.samples]\nmethod = \"halton\"\nranges = {\"car.mass\" = [1.0, 2.0]}": "method = 'halton'",
    "[vary.samples]\ncount = 4": "give a range",
    "seeds = [": "broken TOML",
}  # fmt: skip


@pytest.mark.parametrize("text", BAD)
def test_what_is_wrong_is_named(tmp_path, text):
    with pytest.raises(InputError) as error:
        read(tmp_path, text)
    assert str(error.value).startswith(str(tmp_path / "study.toml")) or "none.toml" in text
    assert BAD[text] in str(error.value)


def test_a_study_of_tables_is_the_same_as_one_of_a_file(tmp_path):
    drive = "\n".join(f"{key} = {value!r}" for key, value in DRIVE["drive"].items())
    text = f"seeds = 3\n[drive]\n{drive}\n[metrics]\nnames = {DRIVE['metrics']['names']!r}\n"
    assert read(tmp_path, text.replace("'", '"')).settings == studies.study_of(DRIVE).settings


def test_ranges_have_equal_steps_or_equal_ratios():
    ranges = {
        "car.mass": {"from": 1000.0, "to": 2000.0, "count": 3},
        "told.mass": {"from": 10.0, "to": 1000.0, "count": 3, "scale": "log"},
    }
    axes = studies.study_of({"vary": ranges}).design.axes
    assert axes[0].labels == (1000.0, 1500.0, 2000.0)
    assert axes[1].labels == pytest.approx((10.0, 100.0, 1000.0))


WHOLE = {
    **DRIVE,
    "drive": {**DRIVE["drive"], "vehicle": "passenger_car", "fidelity": "single-track", "road": "level", "ramp": 0.2},
    "metrics": {"names": ["rmse.sideslip"], "after": 0.5},
    "seed": 0,
    "car": {"mass": 1550.0, "front": {"B": 9.0}},
    "sensors": {"devices": "esc", "a_y": 0.1},
    "channels": {"yaw_rate": "yaw_rate"},
    "estimator": {"name": "state-space", "fidelity": "single-track"},
    "told": {"yaw_inertia": 2300.0},
    "process_noise": {"v_y": 0.05},
    "measurement_noise": {"yaw_rate": 0.01},
    "filter": {"name": "particle-filter", "particles": 10},
    "vary": {
        "drive.speed": [15.0, 20.0],
        "car.mass": {"from": 1400.0, "to": 1700.0, "count": 2, "scale": "linear"},
        "samples": {"method": "latin-hypercube", "count": 3, "seed": 0, "ranges": {"told.mass": [1500.0, 1600.0]}},
    },
}
WRONG = ("x", "", True, [], [[]], [1.0, "a"], {}, {"name": 3}, {"from": 1}, -1e9, 10**30, float("nan"), float("inf"), 0)


def places(table, before=()):
    for key, value in table.items():
        yield (*before, key)
        if isinstance(value, dict):
            yield from places(value, (*before, key))


CASES = [(place, wrong) for place in places(WHOLE) for wrong in WRONG]
random.Random(5).shuffle(CASES)


@pytest.mark.parametrize("part", [0, *(pytest.param(k, marks=pytest.mark.full) for k in range(1, 16))])
def test_a_value_of_any_kind_at_any_place_is_read_or_refused(part):
    for place, wrong in CASES[part::16]:
        told = copy.deepcopy(WHOLE)
        functools.reduce(lambda table, key: table[key], place[:-1], told)[place[-1]] = wrong
        try:
            studies.study_of(told).check()
        except InputError:
            pass
        except Exception as error:
            raise AssertionError(f"{'.'.join(place)} = {wrong!r}: {error!r}") from error


@pytest.mark.parametrize("table", ["drive", "car", "sensors", "told", "process_noise", "measurement_noise"])
def test_no_truth_value_or_text_is_taken_for_a_number(table):
    for key, value in studies.study_of(WHOLE).settings[table].items():
        if isinstance(value, dict):
            continue
        for wrong in (True, [], [[]], "1", ["1"]) if isinstance(value, float) else (True, 1, [], ["level"]):
            told = {**WHOLE, table: {**WHOLE[table], key: wrong}}
            with pytest.raises(InputError, match=re.escape(f"{table}.{key} = ")):
                studies.study_of(told).check()
