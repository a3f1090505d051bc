"""Occupied cells of a grid around a robot from a cloud of points."""

# The bounds between columns, and between rows, in m.
EDGES = [-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5]
SIDE = len(EDGES) + 1


def cloud_occupancy(cloud):
    """Return the cells row by row: 100 if a point in m is in the cell, between floor and ceiling; 0 elsewhere."""
    cells = [0] * SIDE**2
    for p in cloud.points:
        if -2.0 <= p.x < 2.0 and -2.0 <= p.y < 2.0 and 0.1 <= p.z < 1.5:
            column = sum([p.x >= edge for edge in EDGES])
            row = sum([p.y >= edge for edge in EDGES])
            cells[SIDE * row + column] = 100
    corner = {"position": {"x": -2.0, "y": -2.0}, "orientation": {"w": 1.0}}
    grid = {"resolution": 0.5, "width": SIDE, "height": SIDE, "origin": corner}
    return {"header": cloud.header, "info": grid, "data": cells}
