"""Chips as their data sheets describe them, register by register.

A chip takes functions of time for what it measures and a clock for when it is asked. Times are
seconds of the simulation; nothing here looks at a wall clock.
"""
