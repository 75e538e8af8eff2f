"""From laser scans to the light under the tree."""
