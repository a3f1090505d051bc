"""Height and climb rate of a vehicle from the range to the ground, by a Kalman filter."""

PERIOD = 0.02  # between two ranges, in s
MEASURED = 0.0025  # variance of a range, in m^2
# The motion in a period, and the covariance that an unknown acceleration adds in it.
MOTION = [[1.0, PERIOD], [0.0, 1.0]]
ADDED = [[0.25 * PERIOD**4, 0.5 * PERIOD**3], [0.5 * PERIOD**3, PERIOD**2]]


def product(a, b):
    return [[sum([a[i][k] * b[k][j] for k in range(2)]) for j in range(2)] for i in range(2)]


def total(a, b):
    return [[a[i][j] + b[i][j] for j in range(2)] for i in range(2)]


def transposed(a):
    return [[a[j][i] for j in range(2)] for i in range(2)]


class StateKalman:
    def __init__(self):
        self.height = 0.0
        self.rate = 0.0
        self.covariance = [[1.0, 0.0], [0.0, 1.0]]

    def __call__(self, ground):
        """Return height in m, climb rate in m/s, and the variance of the height in m^2, as x, y and z."""
        height, rate = self.height + PERIOD * self.rate, self.rate
        p = total(product(product(MOTION, self.covariance), transposed(MOTION)), ADDED)
        if ground.min_range <= ground.range <= ground.max_range:
            scale = 1.0 / (p[0][0] + MEASURED)
            gain = [p[0][0] * scale, p[1][0] * scale]
            error = ground.range - height
            height, rate = height + gain[0] * error, rate + gain[1] * error
            p = product([[1.0 - gain[0], 0.0], [-gain[1], 1.0]], p)
        self.height, self.rate, self.covariance = height, rate, p
        return {"header": ground.header, "vector": {"x": height, "y": rate, "z": p[0][0]}}


state_kalman = StateKalman()
