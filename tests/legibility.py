"""What can be read of a figure: words large enough in print, whole, and not overwritten."""

from itertools import combinations

import matplotlib as mpl
from matplotlib.figure import Figure

PRINT_WIDTH_IN = 7.1
"""Of a page of two columns (180 mm)."""
LEAST_PRINTED_PT = 5.5
_ROUNDING_IN = 0.02


def smallest_printed_pt(figure: Figure) -> float:
    """Size of the smallest word where the figure is no wider than a page [pt]."""
    figure.draw_without_rendering()
    words = [one for one in figure.findobj(mpl.text.Text) if one.get_text() and one.get_visible()]
    shrunk = min(1, PRINT_WIDTH_IN / figure.get_figwidth())
    return min(one.get_fontsize() for one in words) * shrunk


def is_whole(figure: Figure) -> bool:
    """Whether nothing that is drawn sticks out of the figure."""
    figure.draw_without_rendering()
    drawn = figure.get_tightbbox()
    return (
        min(drawn.x0, drawn.y0) > -_ROUNDING_IN
        and drawn.x1 < figure.get_figwidth() + _ROUNDING_IN
        and drawn.y1 < figure.get_figheight() + _ROUNDING_IN
    )


def overwritten_titles(figure: Figure) -> list[tuple[str, str]]:
    """Pairs of titles of panels that are written over each other."""
    figure.draw_without_rendering()
    titles = [
        one
        for axes in figure.axes
        for one in (axes.title, axes._left_title, axes._right_title)
        if one.get_text() and axes.get_visible()
    ]
    return [
        (a.get_text(), b.get_text())
        for a, b in combinations(titles, 2)
        if a.get_window_extent().overlaps(b.get_window_extent())
    ]


def words_of_axes(figure: Figure) -> str:
    """What its axes, colour bars and the figure itself are labelled with."""
    words = [text.get_text() for text in figure.texts]
    words += [str(getattr(figure, name)()) for name in ("get_supxlabel", "get_supylabel")]
    words += [label for axes in figure.axes for label in (axes.get_xlabel(), axes.get_ylabel())]
    return " ".join(words)
