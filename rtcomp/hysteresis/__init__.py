"""hysteresis"""
