def double(point):
    return {"x": 2 * point["x"], "y": point["y"], "z": point["z"]}
