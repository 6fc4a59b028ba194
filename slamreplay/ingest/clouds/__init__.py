"""Point clouds as planar scans, for logs that hold no LaserScan.

`fields` reads the points out of the messages; `setting` finds out from the first clouds where the
sensor sits, where the floor lies, when points were taken and how dense they are; `flatten` makes
one scan of each cloud; `topics` says which topic, and `second_pass` reads it, batch by batch.

What a scan made of a cloud says, beam by beam (REP-117):

- a range: the nearest surface in the height band. The band holds the sensor's own height, so that
  a return inside the band has travelled inside it all the way: what lies before it is free.
- +inf: some ray went through the band for as far as the cloud sees at all, and what ended it lies
  outside the band or nothing did. "Nothing" is known of spinning lidars alone that keep a place in
  the cloud for every ray (organised clouds): a depth camera's hole may be a wall too near, too
  dark or too bare. A floor or ceiling that a ray meets proves only the way before it left the
  band; where that is shorter the beam stays silent, for a scan has no word for "free up to here".
- NaN: everything else, a bearing without any point above all.
"""

from __future__ import annotations

from collections.abc import Callable

from slamreplay.ingest.clouds.fields import Clouds, clouds_of
from slamreplay.ingest.clouds.points import clouds_of_points
from slamreplay.ingest.decoders.decoder import Messages

#: Message type to what reads points out of its messages.
CLOUD_TYPES: dict[str, Callable[[Messages], Clouds]] = {
    "sensor_msgs/msg/PointCloud2": clouds_of,
    "sensor_msgs/msg/PointCloud": clouds_of_points("sensor_msgs/msg/PointCloud"),
    "foxglove_msgs/msg/PointCloud": clouds_of_points("foxglove_msgs/msg/PointCloud"),
}
