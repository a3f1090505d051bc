"""rosbags' type stores, with the messages of a distribution that rosbags lacks and the product knows."""

from __future__ import annotations

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore


def typestore(store: Stores) -> Typestore:
    """A distribution's types."""
    known = get_typestore(store)
    if store is Stores.ROS1_NOETIC:
        for name in ("tf/msg/tfMessage", "tf2_msgs/msg/TFMessage"):
            known.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", name))
    return known
