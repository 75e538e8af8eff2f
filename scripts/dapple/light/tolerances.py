"""How the tolerance of the light is shared out."""

DIRECT_SHARE, PATH_SHARE = 0.8, 0.35
"""How a tolerance is shared out between shadow rays and paths, with a margin: the real sky is not
the nominal one by which the number of paths is judged."""
