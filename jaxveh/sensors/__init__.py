"""The sensors of a car: sets of channels for filters, and devices with the rates, delays and errors of those in a real car."""

from jaxveh.sensors.camera import LaneCamera
from jaxveh.sensors.device import AbstractDevice, AbstractInstrument
from jaxveh.sensors.faults import AbstractFault, BiasStep, Dropout, Spikes, Stuck
from jaxveh.sensors.gnss import GNSS
from jaxveh.sensors.imu import IMU, Alignment
from jaxveh.sensors.instrumented import Instrumented
from jaxveh.sensors.low_pass import LowPass, low_pass
from jaxveh.sensors.named import DEVICES, NamedDevices, named_devices
from jaxveh.sensors.optical import OpticalSideslip
from jaxveh.sensors.sensor_set import Position, SensorSet, esc
from jaxveh.sensors.signal import Signal
from jaxveh.sensors.steering_angle import SteeringAngle
from jaxveh.sensors.suite import Measured, Suite
from jaxveh.sensors.torque import BrakeTorque, MotorTorque
from jaxveh.sensors.typical import production_car, proving_ground_car
from jaxveh.sensors.wheel_speeds import WheelSpeeds
from jaxveh.sensors.wrapper import AbstractDeviceWrapper, Renamed

__all__ = [
    "DEVICES",
    "GNSS",
    "IMU",
    "AbstractDevice",
    "AbstractDeviceWrapper",
    "AbstractFault",
    "AbstractInstrument",
    "Alignment",
    "BiasStep",
    "BrakeTorque",
    "Dropout",
    "Instrumented",
    "LaneCamera",
    "LowPass",
    "Measured",
    "MotorTorque",
    "NamedDevices",
    "OpticalSideslip",
    "Position",
    "Renamed",
    "SensorSet",
    "Signal",
    "Spikes",
    "SteeringAngle",
    "Stuck",
    "Suite",
    "WheelSpeeds",
    "esc",
    "low_pass",
    "named_devices",
    "production_car",
    "proving_ground_car",
]
