"""What slamreplay found, in the formats of other tools."""

from slamreplay.stage import callable_stage

callable_stage(__name__)
