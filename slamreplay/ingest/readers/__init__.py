"""Containers of messages: each file format gives connections and raw messages, nothing more."""
