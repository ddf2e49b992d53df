"""The numbers of the trial's axis: mechanics, friction, drive, everything that can be hidden; its loop."""

from __future__ import annotations

from typing import NamedTuple

FAR = 1e9
"""A limit that is never met."""


class Physics(NamedTuple):
    """Every parameter of the plant, SI; the defaults leave an effect out."""

    mass: float
    force_constant: float
    voltage_limit: float
    viscous: float
    micro_damping: float
    micro_speed: float
    level: float
    reach: float
    shape: float
    skew: float = 0.0
    offset: float = 0.0
    deadband: float = 0.0
    saturation: float = FAR
    delay: float = 0.0
    lag: float = 0.0
    back_emf: float = 0.0
    ripple: float = 0.0
    ripple_period: float = 1.0
    ripple_phase: float = 0.0
    cogging: float = 0.0
    cogging_period: float = 1.0
    cogging_phase: float = 0.0
    cogging_second: float = 0.0
    spring: float = 0.0
    spring_cubic: float = 0.0
    weight: float = 0.0
    stop_position: float = FAR
    stop_stiffness: float = 0.0
    gap: float = 0.0
    second_mass: float = 0.0
    second_stiffness: float = 0.0
    second_damping: float = 0.0
    quadratic: float = 0.0
    backward_viscous: float = 1.0
    stribeck: float = 0.0
    stribeck_speed: float = 1.0
    place: float = 0.0
    place_period: float = 1.0
    place_phase: float = 0.0
    place_slope: float = 0.0
    load_friction: float = 0.0
    softening: float = 0.0
    friction_lag: float = 0.0
    ageing: float = 0.0
    ageing_distance: float = 1.0
    drift: float = 0.0
    drift_time: float = 1.0
    creep: float = 0.0
    creep_time: float = 1.0
    scale: float = 1.0
    sensor_delay: float = 0.0
    cyclic: float = 0.0
    cyclic_period: float = 1.0
    sensor_drift: float = 0.0
    sensor_drift_time: float = 1.0
    jump: float = 0.0
    jump_time: float = FAR
    tone: float = 0.0
    tone_frequency: float = 1.0
    tone_phase: float = 0.0
    bias: float = 0.0
    bump: float = 0.0
    bump_place: float = 0.0
    bump_width: float = 1.0
    speed_bump: float = 0.0
    speed_bump_at: float = 1.0
    speed_bump_width: float = 1.0
    place_damping: float = 0.0
    place_damping_at: float = 0.0
    place_damping_width: float = 1.0
    walk: float = 0.0
    gain_memory: float = 0.0
    gain_memory_width: float = 1.0
    hump: float = 0.0
    hump_distance: float = 1.0
    spring_square: float = 0.0
    pendulum: float = 0.0
    pendulum_phase: float = 0.0
    cogging_wave: float = 0.0
    ripple_wave: float = 0.0
    place_wave: float = 0.0
    stribeck_exponent: float = 2.0
    drift_form: float = 0.0
    softening_form: float = 0.0


class Loop(NamedTuple):
    """Controller (V/m, V/(m s), V s/m; Hz) and sensor (m rms, m).

    `open` is 1 where the reference is the command (V); up to `cut` (Hz) the sensor shows forces, 0 for what
    is usual.
    """

    kp: float
    ki: float
    kd: float
    rate: float
    noise: float
    resolution: float
    open: float = 0.0
    cut: float = 0.0
