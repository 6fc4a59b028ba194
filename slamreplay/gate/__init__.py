"""Does a log still fare as it must? Rules, what they say of each log, and files for CI."""
