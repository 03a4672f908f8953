"""A running pipeline in other people's viewers, Rerun and Foxglove, through their own SDKs.

`feed` follows the pipeline on the bus, `drawing` says what is to be seen of each sample, and a
canvas (`rerun_canvas`, `foxglove_canvas`) puts it into the words of one viewer.
"""


class NoViewerError(Exception):
    """A viewer's SDK is missing, or the viewer cannot be reached; the text says what helps."""
