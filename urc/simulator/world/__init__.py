"""The simulated world of an emulated robot: pure, with fixed time steps and seeded noise."""
