"""A recorded bag through a simulated system, into another bag."""
