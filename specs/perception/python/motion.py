"""From the place of what is seen to a command that follows it."""

import math


class Smoothing:
    """A filter of first order; without edges, the place stays."""

    def __init__(self, share):
        self.share = share
        self.x = 0.0
        self.y = 0.0

    def __call__(self, point):
        """Return the smoothed place."""
        if point.z > 0.0:
            self.x += self.share * (point.x - self.x)
            self.y += self.share * (point.y - self.y)
        return {"x": self.x, "y": self.y, "z": point.z}


class Tracker:
    """The place as linear velocity, and its change since the last message as angular velocity."""

    def __init__(self):
        self.x = 0.0
        self.y = 0.0

    def __call__(self, point):
        """Return the place and its change."""
        change_x, change_y = point.x - self.x, point.y - self.y
        self.x = point.x
        self.y = point.y
        return {"linear": {"x": point.x, "y": point.y}, "angular": {"x": change_x, "y": change_y}}


def gain(contrast):
    """Return how far the command may trust the image: from 0.25 without contrast to 1."""
    return {"data": 0.25 + 0.75 * contrast.data}


def control(track, trust):
    """Return the velocity that turns to where the place will be, in images of 32 pixels a row."""
    ahead = track.linear.x + 2.0 * track.angular.x
    turn = (16.0 - ahead) / 16.0 * trust.data
    return {"linear": {"x": trust.data * (1.0 - abs(turn))}, "angular": {"z": turn}}


def watch(command):
    """Return the speed of the command."""
    return {"data": math.hypot(command.linear.x, command.angular.z)}


smoothing = Smoothing(0.5)
tracker = Tracker()
