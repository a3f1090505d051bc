"""What follows from the specification: types, data flow, ids, clocks and times."""
