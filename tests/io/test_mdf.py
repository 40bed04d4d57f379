"""MDF4 as measurement systems write it: groups with rasters of their own, invalid samples, words, names twice."""

import numpy as np
import pytest

from jaxveh import InputError, JaxvehWarning, io

asammdf = pytest.importorskip("asammdf")


def write(path, *groups):
    with asammdf.MDF(version="4.10") as mdf:
        for signals in groups:
            mdf.append(signals, common_timebase=True)
        mdf.save(path, overwrite=True)
    return path


def signal(name, time, samples, unit="", **more):
    return asammdf.Signal(np.asarray(samples), np.asarray(time, dtype=float), name=name, unit=unit, **more)


@pytest.fixture
def two_rasters(tmp_path):
    fast, slow = np.arange(6) * 0.01, np.array([0.0, 0.025, 0.04])
    return write(
        tmp_path / "log.mf4",
        [signal("yaw_rate", fast, np.arange(6.0), "deg/s"), signal("a_y", fast, np.arange(6) * 0.1, "g")],
        [signal("v_x", slow, [36.0, 72.0, 90.0], "km/h")],
    )


def test_rasters_are_merged_not_resampled(two_rasters):
    recording = io.read_recording(two_rasters)
    np.testing.assert_array_equal(recording.time, [0.0, 0.01, 0.02, 0.025, 0.03, 0.04, 0.05])
    nan = np.nan
    np.testing.assert_allclose(recording["v_x"], [10.0, nan, nan, 20.0, nan, 25.0, nan], rtol=1e-15)
    np.testing.assert_allclose(recording["yaw_rate"], np.deg2rad([0, 1, 2, nan, 3, 4, 5]), rtol=1e-15)
    np.testing.assert_allclose(recording["a_y"], np.array([0, 0.1, 0.2, nan, 0.3, 0.4, 0.5]) * 9.80665, rtol=1e-15)
    assert recording.unit("v_x") == "m/s"


def test_rasters_resampled_on_request(two_rasters):
    linear = io.read_recording(two_rasters, raster="yaw_rate")
    np.testing.assert_allclose(linear.time, np.arange(6) * 0.01, rtol=1e-15)
    np.testing.assert_allclose(linear["v_x"], [10, 14, 18, 20 + 5 / 3, 25, np.nan], rtol=1e-14)
    held = io.read_recording(two_rasters, raster="v_x", method="hold")
    np.testing.assert_allclose(held.time, [0.0, 0.025, 0.04], rtol=1e-15)
    np.testing.assert_allclose(held["yaw_rate"], np.deg2rad([0, 2, 4]), rtol=1e-14)
    with pytest.raises(InputError, match=r"log.mf4: resample: raster: unknown name\(s\) v_z"):
        io.read_recording(two_rasters, raster="v_z")
    with pytest.raises(InputError, match="method = 'cubic': must be one of 'linear', 'hold'"):
        io.read_recording(two_rasters, raster="v_x", method="cubic")


def test_resample_leaves_long_gaps_open():
    recording = io.merge.merge(
        {
            "a": io.log.Column(np.arange(8.0), np.arange(8.0), ""),
            "b": io.log.Column(np.array([0.0, 2.0, 6.0]), np.array([0.0, 2.0, 6.0]), ""),
        }
    )
    from jaxveh import Recording

    resampled = io.resample(Recording(*recording), "a", "linear", max_gap=3.0)
    np.testing.assert_array_equal(resampled["b"], [0, 1, 2, np.nan, np.nan, np.nan, 6, np.nan])


def test_names_in_two_groups_need_a_group(tmp_path):
    path = write(
        tmp_path / "log.mf4",
        [signal("v", [0.0, 1.0], [1.0, 2.0])],
        [signal("v", [0.0, 1.0], [3.0, 4.0])],
    )
    with pytest.raises(
        InputError, match=r"channel 'v': no group is named, but it is in 0, 1; give one of them as `group`"
    ):
        io.read_recording(path)
    chosen = io.ChannelMap({"v_x": io.Channel("v", group=1)})
    np.testing.assert_array_equal(io.read_recording(path, chosen)["v_x"], [3.0, 4.0])
    with pytest.raises(InputError, match=r"group = 7, but it is in 0, 1"):
        io.read_recording(path, io.ChannelMap({"v_x": io.Channel("v", group=7)}))


def test_invalid_samples_are_missing(tmp_path):
    time = [0.0, 1.0, 2.0]
    invalid = signal("v_x", time, [1.0, 2.0, 3.0], invalidation_bits=np.array([False, True, False]))
    path = write(tmp_path / "log.mf4", [invalid], [signal("v_y", time, [4.0, 5.0, 6.0])])
    recording = io.read_recording(path)
    np.testing.assert_array_equal(recording["v_x"], [1.0, np.nan, 3.0])
    np.testing.assert_array_equal(recording["v_y"], [4.0, 5.0, 6.0])


def test_words_stay_their_numbers_and_text_raises(tmp_path):
    words = {"val_0": 1, "text_0": "on", "val_1": 2, "text_1": "off"}
    path = write(tmp_path / "log.mf4", [signal("switch", [0.0, 1.0], [2, 1], conversion=words)])
    np.testing.assert_array_equal(io.read_recording(path)["switch"], [2.0, 1.0])
    path = write(tmp_path / "log.mf4", [signal("note", [0.0, 1.0], np.array([b"a", b"b"]), encoding="utf-8")])
    with pytest.raises(InputError, match=r"channel 'note', data row 1: b'a' is not a number"):
        io.read_recording(path)


LINEAR = {"a": 0.5, "b": -1.0}
MEASURED_OR_WORDS = {
    "a value for each word": {"val_0": 255, "text_0": b"SNA", "val_1": 254, "text_1": b"error", "default_addr": LINEAR},
    "a range of words": {"lower_0": 254, "upper_0": 255, "text_0": b"SNA", "default_addr": LINEAR},
    "a range of numbers": {
        **{"lower_0": 0, "upper_0": 253, "text_0": LINEAR, "lower_1": 254, "upper_1": 255, "text_1": b"SNA"},
        "default_addr": b"?",
    },
}


@pytest.mark.parametrize("raw", [[0, 2, 255, 4], [255, 254, 255, 255], [0, 2, 3, 4]])
@pytest.mark.parametrize("kind", MEASURED_OR_WORDS)
def test_words_among_measurements_are_missing(tmp_path, kind, raw):
    time, raw = np.arange(4.0), np.array(raw, np.uint8)
    path = write(tmp_path / "log.mf4", [signal("v_x", time, raw, unit="m/s", conversion=MEASURED_OR_WORDS[kind])])
    expected = np.where(raw >= 254, np.nan, 0.5 * raw - 1.0)
    np.testing.assert_array_equal(io.read_recording(path)["v_x"], expected)


@pytest.mark.parametrize("split", [False, True])
def test_the_same_name_of_two_devices(tmp_path, split):
    time = [0.0, 1.0]
    one, other = signal("yaw\\ETKC:1", time, [1.0, 2.0]), signal("yaw\\CAN:2", time, [3.0, 4.0])
    path = write(tmp_path / "log.mf4", *([[one], [other]] if split else [[one, other]]))
    recording = io.read_recording(path)
    assert recording.names == ("yaw\\ETKC:1", "yaw\\CAN:2")
    chosen = io.read_recording(path, io.ChannelMap({"yaw_rate": "yaw\\CAN:2"}))
    np.testing.assert_array_equal(chosen["yaw_rate"], [3.0, 4.0])
    told = (
        r"is in 0, 1; give one"
        if split
        else r"is 2 times in group 0 \(yaw\\ETKC:1, yaw\\CAN:2\); name one of them in full"
    )
    with pytest.raises(InputError, match=told):
        io.read_recording(path, io.ChannelMap({"yaw_rate": "yaw"}))


def test_a_name_that_is_twice_in_one_group(tmp_path):
    path = write(tmp_path / "log.mf4", [signal("v_x", [0.0, 1.0], [1.0, 2.0]), signal("v_x", [0.0, 1.0], [3.0, 4.0])])
    with pytest.raises(InputError, match=r"channel 'v_x': is 2 times in group 0 .*; rename one of them in the file"):
        io.read_recording(path)


def test_time_that_repeats_within_a_group(tmp_path):
    path = write(tmp_path / "log.mf4", [signal("v_x", [0.0, 1.0, 1.0], [1.0, 2.0, 3.0])])
    with pytest.raises(InputError, match=r"channel 'v_x': time\[2\] = 1.0 after time\[1\] = 1.0: must be strictly"):
        io.read_recording(path)


FRAMES = ["CAN_DataFrame", "CAN_RemoteFrame", "CAN_ErrorFrame", "LIN_Frame", "LIN_SyncError", "FLX_Frame", "FLX_Pdu"]


def frames_of(kind):
    """A bus's messages as a bus logger stores them: their identifiers, lengths and bytes."""
    time = np.arange(5) * 0.013
    parts = [("ID", "<u4"), ("DataLength", "u1"), ("DataBytes", "u1", (8,))]
    data = np.zeros(5, dtype=[(f"{kind}.{name}", *form) for name, *form in parts])
    data[f"{kind}.ID"] = 0x120 + np.arange(5)
    return asammdf.Signal(data, time, name=kind)


@pytest.mark.parametrize("kind", FRAMES)
@pytest.mark.parametrize("mapped", [False, True])
def test_frames_alone_ask_for_the_file_that_decodes_them(tmp_path, kind, mapped):
    path = write(tmp_path / "bus.mf4", [frames_of(kind)], [signal(f"{kind}.ID", [0.0, 0.1], [288, 289])])
    channels = io.ChannelMap({"v_x": "VehicleSpeed"}) if mapped else None
    with pytest.raises(
        InputError, match=rf"bus.mf4: holds frames of a bus that .* \({kind}, .*: decode them with the DBC"
    ):
        io.read_recording(path, channels)


@pytest.mark.parametrize("kind", FRAMES)
def test_frames_beside_channels_are_left_out_aloud(tmp_path, kind):
    names = ["v_x", "CAN_VehicleSpeed", "LIN_Temperature", "ETH_delay", "Frame"]
    sound = [signal(name, [0.0, 0.02, 0.04], [1.0, 2.0, 3.0]) for name in names]
    path = write(tmp_path / "bus.mf4", sound, [frames_of(kind)])
    with pytest.warns(JaxvehWarning, match=rf"holds frames of a bus that are not decoded \({kind}, .*not read"):
        recording = io.read_recording(path)
    assert recording.names == tuple(names) and len(recording) == 3
