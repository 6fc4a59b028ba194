"""What slamreplay found, as an mcap file of Foxglove's schemas and a layout that shows it.

Frames: the map frame of the log's end, and in it `base_believed` and `base_hindsight`. Every
message is stamped with the moment it tells of, on the log's own clock. A viewer that jumps to a
moment is given the last message of each topic: therefore each message tells all that its topic has
to tell of that moment.
"""

from slamreplay.export.foxglove.write import write_foxglove

__all__ = ["write_foxglove"]
