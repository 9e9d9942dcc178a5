"""The simulated world of an emulated robot. It is pure, with fixed time steps and seeded noise."""
