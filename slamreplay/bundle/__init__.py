"""The replay bundle and the types that cross stages, with their files."""
