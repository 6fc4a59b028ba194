"""What slamreplay found, in the formats of other tools."""
