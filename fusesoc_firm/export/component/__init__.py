"""A core's target as a component: its ports, interfaces and files."""
