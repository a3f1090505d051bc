"""A recorded bag through a simulated system, and into another bag."""
