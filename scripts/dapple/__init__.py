"""From laser scans to the light under the tree."""

VERSION = "0.1.0"
