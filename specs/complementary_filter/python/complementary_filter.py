"""Roll and pitch of a vehicle from its inertial sensors, by a complementary filter."""

import math


class ComplementaryFilter:
    def __init__(self, period, time_constant):
        """Take the period of the messages, and the time in which gravity corrects the gyroscopes, in s."""
        self.period = period
        self.gain = period / (time_constant + period)
        self.roll = 0.0
        self.pitch = 0.0

    def __call__(self, imu):
        """Return roll and pitch in rad as x and y, from rates in rad/s and accelerations in m/s^2."""
        rate, gravity = imu.angular_velocity, imu.linear_acceleration
        roll = math.atan2(gravity.y, gravity.z)
        pitch = math.atan2(-gravity.x, math.sqrt(gravity.y**2 + gravity.z**2))
        self.roll = self.mixed(self.roll + self.period * rate.x, roll)
        self.pitch = self.mixed(self.pitch + self.period * rate.y, pitch)
        return {"header": imu.header, "vector": {"x": self.roll, "y": self.pitch}}

    def mixed(self, turned, seen):
        """Return the angle between the one turned since the last message and the one seen now."""
        return turned + self.gain * (seen - turned)


complementary_filter = ComplementaryFilter(period=0.01, time_constant=0.5)
