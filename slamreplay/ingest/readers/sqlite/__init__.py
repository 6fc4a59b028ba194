"""SQLite files read by their pages: damaged ones, and those with a write-ahead log."""
