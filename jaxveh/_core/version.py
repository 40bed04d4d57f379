"""The package's version, which every subpackage can import."""

VERSION = "0.2.0"
