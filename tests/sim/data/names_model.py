"""What the system of names.yaml answers."""


def respond(subscriber, message):
    rotated = {"x": message["z"], "y": message["x"], "z": message["y"]}
    return [(publisher, rotated) for publisher in ("arm/left__joint", "m_axis", "2nd")]
