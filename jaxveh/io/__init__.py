"""Files: recordings (CSV, Parquet, MDF4, NetCDF, MCAP; MATLAB and VBOX for reading), channel maps, data frames, car files, road
files, tyre property files, CommonRoad's vehicle files, and tables of tyre test rigs (CSV, TYDEX, FSAE TTC).

The extra `io` has pandas, pyarrow, asammdf, pint, pyyaml, scipy and h5py, the extra `mcap` has mcap; each is imported when used.
"""

from jaxveh.io import kit
from jaxveh.io.canonical import CANONICAL, CanonicalChannel, canonical_unit
from jaxveh.io.car import AxleTyre, CarSpecification, read_car, write_car
from jaxveh.io.channel_map import Channel, ChannelMap, read_channel_map
from jaxveh.io.commonroad import CommonRoadSpecification, read_commonroad
from jaxveh.io.files import check_readable, making_folder, replacing_file, write_text
from jaxveh.io.frames import from_frame, to_frame, write_frame
from jaxveh.io.mcap_log import write_topics
from jaxveh.io.merge import resample
from jaxveh.io.property_file import PropertyFile, read_property_file, write_property_file
from jaxveh.io.recordings import LOG_SUFFIXES, SUFFIXES, read_recording, with_units_in_names, write_recording
from jaxveh.io.rig_table import RigTable, read_rig_table
from jaxveh.io.road import RoadSpecification, read_road, write_road
from jaxveh.io.steering import with_road_steer
from jaxveh.io.tydex import TydexFile, read_tydex

__all__ = [
    "CANONICAL",
    "LOG_SUFFIXES",
    "SUFFIXES",
    "AxleTyre",
    "CanonicalChannel",
    "CarSpecification",
    "Channel",
    "ChannelMap",
    "CommonRoadSpecification",
    "PropertyFile",
    "RigTable",
    "RoadSpecification",
    "TydexFile",
    "canonical_unit",
    "check_readable",
    "from_frame",
    "kit",
    "making_folder",
    "read_car",
    "read_channel_map",
    "read_commonroad",
    "read_property_file",
    "read_recording",
    "read_rig_table",
    "read_road",
    "read_tydex",
    "replacing_file",
    "resample",
    "to_frame",
    "with_road_steer",
    "with_units_in_names",
    "write_car",
    "write_frame",
    "write_property_file",
    "write_recording",
    "write_road",
    "write_text",
    "write_topics",
]
