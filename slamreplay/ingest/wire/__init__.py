"""Messages straight from bytes: whole topics at once, as columns, without a Python object each.

`layout` says what a type looks like on the wire, `walk` finds where every field of every message
is, `messages` reads the fields that a decoder asks for.
"""
