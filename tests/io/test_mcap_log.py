"""MCAP as a log: topics that `write_topics` wrote, and strangers'."""

import json

import numpy as np
import pytest

from jaxveh import InputError, Recording, io

writing = pytest.importorskip("mcap.writer")

S = 10**9


def write(path, topics, encoding="json", compression=None, schema=b"{}", name="its/msg/Car"):
    """Topics by name: (stamp in ns, message) each, in any order."""
    more = {} if compression is None else {"compression": compression}
    with path.open("wb") as stream:
        writer = writing.Writer(stream, **more)
        writer.start(profile="", library="a stranger's")
        known = writer.register_schema(name, "jsonschema" if encoding == "json" else "ros2msg", schema)
        for topic, messages in topics.items():
            channel = writer.register_channel(topic, encoding, known)
            for k, (stamp, message) in enumerate(messages):
                data = message if isinstance(message, bytes) else json.dumps(message).encode()
                writer.add_message(channel, log_time=stamp, data=data, publish_time=stamp, sequence=k)
        writer.finish()


def test_what_was_written_comes_back(tmp_path):
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.integers(1, 2000, 300)) / 1000  # whole milliseconds, which nanoseconds hold
    log = Recording(
        time, {"yaw_rate": rng.normal(size=300) * 1e-5, "pedal": np.where(rng.random(300) < 0.3, np.nan, 1 / 3)},
        {"yaw_rate": "rad/s", "pedal": "mm"}, "the car's own bus",
    )  # fmt: skip
    io.write_topics({"/log": io.to_frame(log)}, tmp_path / "log.mcap")
    again = io.read_recording(tmp_path / "log.mcap")
    assert again.names == log.names and again.units == log.units and again.source == log.source
    np.testing.assert_array_equal(again.time, log.time)
    for name in log.names:
        np.testing.assert_array_equal(again[name], log[name])


IMU = [(k * S // 100, {"header": {"frame_id": "imu", "seq": k}, "angular_velocity": {"x": 0.0, "z": 0.1 * k},
                       "ok": True}) for k in range(5)]  # fmt: skip
GPS = [(k * S // 50, {"v": [20.0, k], "fix": None if k == 1 else 3}) for k in range(3)]


@pytest.mark.parametrize("compression", ["NONE", "LZ4", "ZSTD"])
def test_strangers_topics_of_several_rates(tmp_path, compression):
    write(tmp_path / "log.mcap", {"/imu": IMU, "/gps": GPS}, compression=getattr(writing.CompressionType, compression))
    found = io.read_recording(tmp_path / "log.mcap")
    assert found.names == ("header.seq", "angular_velocity.x", "angular_velocity.z", "ok", "v[0]", "v[1]", "fix")
    np.testing.assert_array_equal(found.time, np.arange(5) / 100)
    np.testing.assert_array_equal(found["angular_velocity.z"], [0.1 * k for k in range(5)])
    np.testing.assert_array_equal(found["v[1]"], [0, np.nan, 1, np.nan, 2])
    np.testing.assert_array_equal(found["fix"], [3, np.nan, np.nan, np.nan, 3])
    np.testing.assert_array_equal(found["ok"], 1.0)
    chosen = io.ChannelMap({"yaw_rate": io.Channel("/imu.angular_velocity.z", unit="deg/s")})
    np.testing.assert_allclose(
        io.read_recording(tmp_path / "log.mcap", chosen)["yaw_rate"], np.radians(found["angular_velocity.z"])
    )


def test_a_name_in_two_topics_is_a_whole_path_in_both(tmp_path):
    write(tmp_path / "log.mcap", {"/a": [(0, {"v": 1, "w": 3})], "/b": [(0, {"v": 2})]})
    assert io.read_recording(tmp_path / "log.mcap").names == ("/a.v", "w", "/b.v")
    with pytest.raises(InputError, match=r"no column '/a.vv' \(did you mean '/a.v'"):
        io.read_recording(tmp_path / "log.mcap", io.ChannelMap({"v_x": "/a.vv"}))


def test_stamps_are_rounded_once(tmp_path):
    stamps = [1_700_000_000_123_456_789, 1_700_000_000_223_456_789]
    write(tmp_path / "log.mcap", {"/a": [(stamp, {"v": 1}) for stamp in stamps]})
    assert list(io.read_recording(tmp_path / "log.mcap").time) == [1_700_000_000.123456789, 1_700_000_000.223456789]


def test_lists_are_taken_apart_up_to_64(tmp_path):
    write(tmp_path / "log.mcap", {"/a": [(0, {"scan": [0.0] * 65, "rays": [0.0] * 64, "w": 10**400})]})
    found = io.read_recording(tmp_path / "log.mcap")
    assert found.names == (*(f"rays[{k}]" for k in range(64)), "w") and np.isinf(found["w"][0])


def test_what_cannot_be_read_is_told_with_its_encoding(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mcap_ros2.decoder", None)
    path = tmp_path / "log.mcap"
    write(path, {"/imu": [(0, b"\0\1")]}, "cdr")
    with pytest.raises(InputError, match=r"found: /imu \(cdr\)\. ROS 2 topics .* `pip install mcap-ros2-support`"):
        io.read_recording(path)
    write(path, {"/imu": [(0, b"\0\1")]}, "protobuf")
    with pytest.raises(InputError, match=r"found: /imu \(protobuf\)\.$"):
        io.read_recording(path)
    write(path, {"/says": [(0, {"text": "hello"})]})
    with pytest.raises(InputError, match=r"found: /says \(no numbers\)"):
        io.read_recording(path)
    write(path, {"/imu": [(0, b"not json")]})
    with pytest.raises(InputError, match=r"is not a readable MCAP file"):
        io.read_recording(path)


def test_ros_2_messages_are_read_where_their_library_is(tmp_path):
    pytest.importorskip("mcap_ros2")
    schema = b"float64 speed\nVector v\n" + b"=" * 80 + b"\nMSG: its/Vector\nfloat32 x\nint8[2] y"
    data = b"\x00\x01\x00\x00" + np.float64(20.5).tobytes() + np.float32(1.5).tobytes() + b"\x03\xff"
    write(tmp_path / "log.mcap", {"/car": [(0, data), (S, data)]}, "cdr", schema=schema)
    found = io.read_recording(tmp_path / "log.mcap")
    assert {name: float(found[name][1]) for name in found.names} == {
        "speed": 20.5,
        "v.x": 1.5,
        "v.y[0]": 3,
        "v.y[1]": -1,
    }


def test_two_messages_at_one_instant(tmp_path):
    write(tmp_path / "log.mcap", {"/a": [(0, {"v": 1}), (0, {"v": 2})]})
    with pytest.raises(InputError, match=r"column 'v': time\[1\] = 0.0 after time\[0\] = 0.0"):
        io.read_recording(tmp_path / "log.mcap")
