"""The pipeline file: its model, how it is read, and everything that can be wrong in it."""
