"""What first versions of accelerators are sent, and the zeros that they answer with, for stimuli and models."""

IMAGE_STIMULUS = """
- image:
    header: {seq: 1, stamp: {sec: 2, nsec: 3}, frame_id: here}
    height: 2
    width: 3
    encoding: mono8
    is_bigendian: 0
    step: 3
    data: [1, 2, 3, 4, 5, 6]
"""
ZEROS = """
ZEROS = {"x": 0.0, "y": 0.0, "z": 0.0}
POSE = {"position": ZEROS, "orientation": {**ZEROS, "w": 0.0}}
STAMP = {"sec": 0, "nsec": 0}
IMAGE = {"header": {"seq": 0, "stamp": STAMP, "frame_id": ""}, "height": 0, "width": 0, "encoding": "",
         "is_bigendian": 0, "step": 0, "data": []}
"""
