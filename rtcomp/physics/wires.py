"""The wires of a stage: the numbers that effects read and change, by place in one array.

Every effect kernel gets the same array `w`. Forces act on the mass, positive with position; friction
opposes motion. All SI.
"""

from __future__ import annotations

TIME = 0  # s, since the start
STEP = 1  # s, length of this integration step
VOLTS = 2  # V, command on its way through the drive
DRIVE = 3  # N, force of the drive on the mass
POSITION = 4  # m, true position of the mass
VELOCITY = 5  # m/s
ACCELERATION = 6  # m/s^2, of the last step
MOVED = 7  # m, displacement since the last call
PUSH = 8  # N, other forces on the mass, positive with position (springs, gravity, disturbances)
FRICTION = 9  # N, friction, opposing motion: positive when the mass moves forward
REACH = 10  # 1, multiplies the yield level of the friction model at equal stiffness (Stribeck and kin)
SCALE = 11  # 1, multiplies the whole force of the friction model (position dependence, drift and kin)
MASS = 12  # kg, moving mass
GAIN = 13  # N/V, force per volt
SENSED = 14  # m, position on its way through the sensor
NOISE = 15  # 1, a fresh standard normal number for the sensor

COUNT = 16
