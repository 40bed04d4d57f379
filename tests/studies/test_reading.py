"""A study's file: the schema reads as it is; what is wrong is named with what there is."""

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
    for part in ("car.mass", "told.front.D", "told.yaw_inertia", "the sensors' noise as it is"):
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
    "seeds = 0": "seeds = 0: must be a whole number of at least 1",
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
    "seed = 99999999999999999999": "seed = 99999999999999999999: must be at most 9223372036854775807",
    '[vary.samples]\nseed = 9223372036854775808\nranges = {"car.mass" = [1.0, 2.0]}': "= 9223372036854775808: must be at most",
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
