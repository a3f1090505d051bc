"""The system derived from it: types, data flow, ids, clocks and times."""
