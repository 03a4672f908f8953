"""A robot on a floor of magnets, down to the registers of its chips."""
