"""Looks at a robot's hardware and says, check by check, what is wrong and what to do about it."""
