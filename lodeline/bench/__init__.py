"""Measurements that `lodeline bench` makes, one module each."""
