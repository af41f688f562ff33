"""The blocks of the configuration of a study."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from accelstudy.config_names import ModelName, SchemeName
from accelstudy.files.validation import (
    Angle,
    Attitudes,
    BaseSamples,
    Block,
    Duration,
    Finite,
    GravityError,
    Interval,
    OneOrMore,
    Pitch,
    Rate,
    Replicates,
    Resamples,
    SigmaAngle,
    SigmaForce,
    SigmaGravity,
    Temperature,
    Tilt,
    Vibration,
)
from accelstudy.leveling.error import ATTITUDES, MAX_TILT_GON

Temperatures = tuple[Temperature, Temperature]
Vibrations = tuple[Vibration, Vibration]
"""Two numbers, from and to."""


class SensorNoise(Block):
    """White noise of the accelerometer."""

    sigma_mps2: SigmaForce = Field(0.002, description="standard deviation per axis, m/s²")
    per: Literal["position", "sample"] = Field(
        "position", description="whether sigma_mps2 is that of a position's mean or of one sample"
    )
    rate_hz: Rate = Field(100.0, description="sampling rate; used with per: sample")
    duration_s: Duration = Field(2.0, description="duration of a hold; used with per: sample")


class RobotNoise(Block):
    """Noise of the robot's angles."""

    sigma_mgon: SigmaAngle = Field(3.2, description="standard deviation of roll and of pitch")


class GravityNoise(Block):
    """What is known of local gravity."""

    sigma_mps2: SigmaGravity = Field(
        0.0, description="standard deviation of the value used; 0 holds it fixed in the adjustment"
    )
    error_mps2: GravityError = Field(0.0, description="systematic error of the value used")


class NoiseConfig(Block):
    """The stochastic model of all cells, except where a grid gives other values."""

    sensor: SensorNoise = SensorNoise()
    robot: RobotNoise = RobotNoise()
    gravity: GravityNoise = GravityNoise()
    effects: list[str] = Field(
        default_factory=list,
        description="noise effects of the forces, e.g. heavy_tails(nu=3), in the order in which "
        "they act; the calibration ignores them",
    )


class HoldPlanConfig(Block):
    """Conditions of the holds, on which some effects depend."""

    interval_s: Interval | None = Field(None, description="time between holds")
    temperature_degC: Temperatures | None = Field(None, description="temperatures from and to")
    temperature_order: Literal["linear", "ABBA", "random"] = Field(
        "linear", description="course of the temperature; ABBA: in quarters of the session"
    )
    vibration_mps2: Vibrations | None = Field(
        None, description="rms of the vibration, drawn for each hold between these"
    )
    yaw: Literal["none", "random"] = Field("none", description="yaw of the robot: zero, or drawn")


HOLD_KEYS = {
    "time": "holds.interval_s",
    "temperature": "holds.temperature_degC",
    "vibration": "holds.vibration_mps2",
}
"""Columns of the holds and the keys that provide them."""


class Quantity(Block):
    """True values of the parameters of one effect."""

    value: OneOrMore[Finite] = Field(description="one number per parameter of the effect")
    unit: str = Field(description="unit of the values, e.g. mgon, ppm, m/s^2")


class Grid(Block):
    """Cells: every combination of what is listed. A single value may stand for a list of one."""

    models: OneOrMore[ModelName] = Field(
        description="models: names, compositions as bias-scale+warm_up(tau=300), YAML files with a "
        "model; or all"
    )
    schemes: OneOrMore[SchemeName] = Field(
        description="schemes: names, YAML files as `accelstudy design` writes them; or all"
    )
    approaches: OneOrMore[str] = Field(
        default=["gravity", "robot"], description="names of approaches, or all"
    )
    replicates: Replicates = Field(description="simulated calibrations per cell")
    sensor_sigma_mps2: OneOrMore[SigmaForce] | None = Field(
        None, description="noise.sensor.sigma_mps2"
    )
    robot_sigma_mgon: OneOrMore[SigmaAngle] | None = Field(
        None, description="noise.robot.sigma_mgon"
    )
    gravity_sigma_mps2: OneOrMore[SigmaGravity] | None = Field(
        None, description="noise.gravity.sigma_mps2"
    )
    gravity_error_mps2: OneOrMore[GravityError] | None = Field(
        None, description="noise.gravity.error_mps2"
    )


class Presets(Block):
    """The rows of the paper's Table 1, each with its own model and scheme."""

    replicates: Replicates = Field(description="simulated calibrations per row and approach")
    approaches: OneOrMore[str] = Field(
        default=["gravity", "robot"], description="names of approaches, or all"
    )


class LevelingConfig(Block):
    """Where the tilt error that a calibration leaves is evaluated."""

    max_tilt_gon: Tilt = Field(
        MAX_TILT_GON, description="largest tilt of the z axis from the vertical"
    )
    attitudes: Attitudes = Field(
        ATTITUDES, description="least number of attitudes, spread evenly over these tilts"
    )


class SensitivityConfig(Block):
    """Variance-based sensitivity analysis of leveling (figures 4 to 6)."""

    base_samples: BaseSamples = Field(1024, description="Sobol base samples, a power of two")
    resamples: Resamples = Field(100, description="bootstrap resamples for confidence intervals")
    roll_gon: OneOrMore[Angle] = Field(description="rolls of the grid")
    pitch_gon: OneOrMore[Pitch] = Field(description="pitches of the grid")
    model: ModelName = Field("bias-scale-nonorthogonality", description="model of figures 5 and 6")
    scheme: SchemeName = Field("mclaren-24", description="scheme whose calibration gives the sds")
