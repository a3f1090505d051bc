"""Programs, worker processes and machines."""
