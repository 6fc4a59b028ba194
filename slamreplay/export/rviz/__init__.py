"""What was found, for RViz: map overlays as map_server's files, a log to play, a configuration."""
