"""The supervisor: starts the processes of a pipeline, keeps them alive, stops them in order.

It knows nothing of zenoh: a process is a command, a socket for its word, and a pipe for its log.
"""
