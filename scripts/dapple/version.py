"""The version of dapple."""

VERSION = "0.1.0"
