"""What the measurements are made on: simulated drives."""
