"""Lodeline: real-time localisation for wheeled robots as a dataflow pipeline."""
