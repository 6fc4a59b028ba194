"""The program's version, apart from the root package: that offers all the rest to notebooks."""

__version__ = "0.1.0"
