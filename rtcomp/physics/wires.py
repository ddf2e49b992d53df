"""The wires of a stage: the numbers that effects read and change, by place in one array.

Every effect kernel gets the same array `w`. Forces act on the mass, positive with position; friction
opposes motion. All SI.

Who drives the chain resets before each step what effects add to (DRIVE, PUSH, FRICTION: 0), multiply (REACH,
SCALE: 1) and take from the stage (MASS, GAIN). GRIP, GRIP_LEVEL, GRIP_STIFFNESS and BEHIND stay from step to
step: written late in the chain, they are read before that at the next step (0 at first). LATE, LATE_MIDWAY,
SKEW, STIFFENS, FOLLOWS and SOFTENS are written by their one effect at each step and are 0 without it. A stage
has one friction model; of two, the later one's GRIP would be read.
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

GRIP = 16  # N, force of the friction model after its last step, without damping
GRIP_LEVEL = 17  # N, at which its sliding settles at REACH and SCALE 1
GRIP_STIFFNESS = 18  # N/m, its slope at rest with everything sticking
BEHIND = 19  # N, friction on the load behind a play, less what pushes it, after its last step
LATE = 20  # m/s, how far the speed that speed-dependent friction sees is behind
SKEW = 21  # 1, speed-dependent friction is 1 + SKEW times larger forward, 1 - SKEW backward
GRAIN = 22  # m, motion smaller than this is the sensor's noise; 0 in simulation
STIFFENS = 23  # 1, how much levels that change late stiffen what sticks: 0 they only hold more, 1 all grows
FOLLOWS = 24  # 1, how much what sticks follows such levels at once
LATE_MIDWAY = 25  # m/s, LATE in the middle of the step
SOFTENS = 26  # 1, how much steeper elements of the friction model are at rest, less steep where they yield
AHEAD = 27  # N, other forces on the driven mass where there is a play: PUSH is then that on the load
PLAYED = 28  # m, position of the load behind a play, from the driven mass

COUNT = 29
