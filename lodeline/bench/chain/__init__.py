"""A chain of processes from an IMU to a pose, on our pipeline and on what else there is."""
