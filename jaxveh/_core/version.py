"""The package's version, where every room can see it."""

VERSION = "0.2.0"
