"""Topics of an MCAP file, read back by its own library."""

import json

import numpy as np
import pytest

from jaxveh import InputError, Recording, io

reading = pytest.importorskip("mcap.reader")
pandas = pytest.importorskip("pandas")


def read(path):
    """The file's messages in its order, (topic, stamp in ns, numbers), and channel and schema by topic."""
    with path.open("rb") as stream:
        reader = reading.make_reader(stream, validate_crcs=True)
        messages, about = [], {}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            messages.append((channel.topic, message.log_time, json.loads(message.data)))
            assert message.publish_time == message.log_time
            about[channel.topic] = channel, schema
        return messages, about


FAST = Recording(
    [0.0, 0.1, 0.25, 1e9 + 0.125], {"yaw_rate": [0.1, -1e-17, 3e22, 2.0], "oil": [1.0, np.nan, np.inf, 4.0]},
    {"yaw_rate": "rad/s"}, "the car's own bus",
)  # fmt: skip
SLOW = Recording([0.1, 0.2], {"v_y": np.array([1 / 3, 2 / 3])}, {"v_y": "m/s"})


def test_messages_are_the_rows_in_the_order_of_time(tmp_path):
    path = tmp_path / "two.mcap"
    io.write_topics({"/log": io.to_frame(FAST), "/truth": io.to_frame(SLOW)}, path)
    messages, about = read(path)
    assert messages == [
        ("/log", 0, {"yaw_rate": 0.1, "oil": 1.0}),
        ("/log", 100_000_000, {"yaw_rate": -1e-17}),
        ("/truth", 100_000_000, {"v_y": 1 / 3}),
        ("/truth", 200_000_000, {"v_y": 2 / 3}),
        ("/log", 250_000_000, {"yaw_rate": 3e22}),
        ("/log", 1_000_000_000_125_000_000, {"yaw_rate": 2.0, "oil": 4.0}),
    ]
    channel, schema = about["/log"]
    assert channel.message_encoding == "json" and channel.metadata == {"source": "the car's own bus"}
    assert schema.encoding == "jsonschema" and schema.name == "jaxveh.log"
    content = json.loads(schema.data)
    assert content["type"] == "object"
    assert content["properties"] == {"yaw_rate": {"type": "number", "description": "rad/s"}, "oil": {"type": "number"}}
    assert about["/truth"][1].name == "jaxveh.truth" and about["/truth"][0].metadata == {}


def test_numbers_come_back_bit_for_bit(tmp_path):
    values = np.random.default_rng(0).normal(size=500) * 10.0 ** np.random.default_rng(1).integers(-300, 300, 500)
    single = values.clip(-1e30, 1e30).astype(np.float32)
    frame = pandas.DataFrame(
        {"time": np.arange(500) * 0.01, "double": values, "single": single, "whole": np.arange(500)}
    )
    io.write_topics({"/log": frame}, tmp_path / "log.mcap")
    rows = [row for _, _, row in read(tmp_path / "log.mcap")[0]]
    np.testing.assert_array_equal([row["double"] for row in rows], values)
    np.testing.assert_array_equal(np.array([row["single"] for row in rows], np.float32), single)
    np.testing.assert_array_equal([row["whole"] for row in rows], np.arange(500))


def test_what_is_refused(tmp_path):
    frame, path = io.to_frame(SLOW), tmp_path / "log.mcap"
    with pytest.raises(InputError, match=r"suffix '.csv'; a recording of topics must end in one of .mcap"):
        io.write_topics({"/log": frame}, tmp_path / "log.csv")
    with pytest.raises(InputError, match="no topic to write"):
        io.write_topics({}, path)
    with pytest.raises(InputError, match="topic /log: no column `time`; there are: a"):
        io.write_topics({"/log": pandas.DataFrame({"a": [1.0]})}, path)
    wrong = (([-0.5, 1.0], "0] = -0.5"), ([0.0, 0.0], "1] = 0.0"), ([0.0, np.nan], "1] = nan"), ([0.0, 1e10], "1] = 1"))
    for time, value in wrong:
        with pytest.raises(InputError, match=r"stamps must be at least zero and strictly increasing") as raised:
            io.write_topics({"/log": pandas.DataFrame({"time": time, "a": [1.0, 2.0]})}, path)
        assert f"time[{value}" in str(raised.value)
    with pytest.raises(InputError, match="column 'a', data row 1: 'x' is not a number"):
        io.write_topics({"/log": pandas.DataFrame({"time": [0.0], "a": ["x"]})}, path)
    assert not list(tmp_path.iterdir())
    io.write_topics({"/log": frame}, path)
    with pytest.raises(InputError, match="exists already"):
        io.write_topics({"/log": frame}, path)
    io.write_topics({"/log": frame}, path, overwrite=True)
