"""Types of the keys that have a dimension: text with a unit in the file, a float in the SI unit inside."""

from typing import Annotated

from detent.files.fields import Unit

INCH = 0.0254  # one inch [m]
Length = Annotated[float, Unit("m")]
Velocity = Annotated[float, Unit("m/s")]
Acceleration = Annotated[float, Unit("m/s^2")]
Time = Annotated[float, Unit("s")]
Frequency = Annotated[float, Unit("Hz")]
Mass = Annotated[float, Unit("kg")]
Inertia = Annotated[float, Unit("kg*m^2")]
Force = Annotated[float, Unit("N")]
Viscosity = Annotated[float, Unit("N*s/m")]
TorqueConstant = Annotated[float, Unit("N*m/A")]
BackEmfConstant = Annotated[float, Unit("V*s/rad")]
Voltage = Annotated[float, Unit("V")]
Resistance = Annotated[float, Unit("ohm")]
Inductance = Annotated[float, Unit("H")]
Current = Annotated[float, Unit("A")]
Angle = Annotated[float, Unit("rad")]
AngularVelocity = Annotated[float, Unit("rad/s")]
AngularAcceleration = Annotated[float, Unit("rad/s^2")]
Torque = Annotated[float, Unit("N*m")]
Percentage = Annotated[float, Unit("%")]
Jerk = Annotated[float, Unit("m/s^3")]
Stiffness = Annotated[float, Unit("N/m")]
ForcePerVoltage = Annotated[float, Unit("N/V")]
CurrentPerVoltage = Annotated[float, Unit("A/V")]
VoltagePerVelocity = Annotated[float, Unit("V*s/m")]
VoltagePerLength = Annotated[float, Unit("V/m")]
VoltagePerLengthTime = Annotated[float, Unit("V/(m*s)")]
