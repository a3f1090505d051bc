"""A PID controller with a limited integral part: the set point is x, the measurement y."""


class Pid:
    def __init__(self):
        self.integral = 0.0
        self.before = 0.0

    def __call__(self, message):
        error = message.x - message.y
        self.integral = min(max(self.integral + 0.01 * error, -10.0), 10.0)
        slope = error - self.before
        self.before = error
        return {"data": 1.5 * error + self.integral + 0.2 * slope}


pid = Pid()
pid32 = Pid()
