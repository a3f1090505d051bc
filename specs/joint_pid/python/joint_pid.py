"""Efforts of four joints by PID controllers."""


class JointPid:
    def __init__(self, proportional, integral, derivative, limit):
        """Take gains per period of the control loop, in N m/rad, and the limit of the integral part, in N m."""
        self.proportional, self.integral, self.derivative = proportional, integral, derivative
        self.limit = limit
        self.sums = [0.0] * 4
        self.errors = [0.0] * 4

    def __call__(self, state, targets):
        """Return the effort of each joint in N m, from measured angles and targets in rad."""
        efforts = []
        for i, angle in enumerate(state.position):
            joint = i % 4
            error = targets.angles[joint] - angle
            self.sums[joint] = min(max(self.sums[joint] + self.integral * error, -self.limit), self.limit)
            slope = error - self.errors[joint]
            self.errors[joint] = error
            efforts.append(self.proportional * error + self.sums[joint] + self.derivative * slope)
        return {"data": efforts}


joint_pid = JointPid(proportional=1.5, integral=0.01, derivative=0.2, limit=10.0)
