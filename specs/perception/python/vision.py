"""From an image to its edges, and from the edges to the place and the contrast of what is seen."""

# Differences of neighbours that are not noise.
NOISE = 24


def edges(image):
    """Return an image of the differences between neighbours in a row."""
    before = 0
    data = []
    for value in image.data:
        difference = abs(int(value) - before)
        before = int(value)
        data.append(difference if difference >= NOISE else 0)
    kept = {"header": image.header, "height": image.height, "width": image.width, "step": image.step}
    return {**kept, "encoding": "mono8", "data": data}


def regions(image):
    """Return the centre of the edges in pixels as x and y, and the sum of their values as z."""
    column, row = 0, 0
    sum_x, sum_y, weight = 0, 0, 0
    for value in image.data:
        sum_x += column * int(value)
        sum_y += row * int(value)
        weight += int(value)
        column += 1
        if column == image.width:
            column, row = 0, row + 1
    if weight == 0:
        return {"x": 0.0, "y": 0.0, "z": 0.0}
    return {"x": sum_x / weight, "y": sum_y / weight, "z": float(weight)}


def contrast(image):
    """Return the greatest difference of neighbours, from 0 to 1."""
    greatest = 0
    for value in image.data:
        greatest = max(greatest, int(value))
    return {"data": greatest / 255.0}
