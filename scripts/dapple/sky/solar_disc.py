"""How large the sun looks."""

SUN_DIAMETER_DEG = 0.533
"""Angular diameter of the solar disc at the Earth's mean distance: 1.3914 of 149.6 million km."""
