"""Tools to read and write further kinds of files."""

from jaxveh.io.car import CAR_SCHEMA, STEERINGS, car_lines, car_of_toml, check_car_file
from jaxveh.io.channel_map import CHANNEL_MAP_SCHEMA
from jaxveh.io.datasets import dataset_of, frame_of, of_dataset
from jaxveh.io.likely_names import MOST_LIKELY, likely_names, likely_words, words_of
from jaxveh.io.mcap_log import MCAP_SUFFIX
from jaxveh.io.naming import MOST_NAMED, check_known
from jaxveh.io.nested_log import in_words
from jaxveh.io.optional import require
from jaxveh.io.property_file import PROPERTY_UNITS, Entry, parse_property_file
from jaxveh.io.result_files import RESULT_SUFFIXES, load_result, save_result
from jaxveh.io.rig_table import RIG_CHANNELS
from jaxveh.io.steering import USUAL_MIDDLE_SPEED, check_front_steered, rear_ratio
from jaxveh.io.toml import (
    FILES,
    check_file,
    check_keys,
    read_toml,
    shorten,
    toml_number,
    toml_string,
    toml_text,
    write_toml,
)
from jaxveh.io.units import is_unit, same_unit

__all__ = [
    "CAR_SCHEMA",
    "CHANNEL_MAP_SCHEMA",
    "FILES",
    "MCAP_SUFFIX",
    "MOST_LIKELY",
    "MOST_NAMED",
    "PROPERTY_UNITS",
    "RESULT_SUFFIXES",
    "RIG_CHANNELS",
    "STEERINGS",
    "USUAL_MIDDLE_SPEED",
    "Entry",
    "car_lines",
    "car_of_toml",
    "check_car_file",
    "check_file",
    "check_front_steered",
    "check_keys",
    "check_known",
    "dataset_of",
    "frame_of",
    "in_words",
    "is_unit",
    "likely_names",
    "likely_words",
    "load_result",
    "of_dataset",
    "parse_property_file",
    "read_toml",
    "rear_ratio",
    "require",
    "same_unit",
    "save_result",
    "shorten",
    "toml_number",
    "toml_string",
    "toml_text",
    "words_of",
    "write_toml",
]
