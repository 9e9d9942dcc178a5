"""The small world in which emulated robots move and sense: pure, stepped by dt, seeded."""
