"""The colours of mining steps as a row of blocks, a block for each step, named as far as there is room."""

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from catalogs.figures import style

BLOCK_HEIGHT = 0.11  # Inches.
MAX_BLOCK_WIDTH = 0.95  # Inches.
LETTERS = 7.5  # Points.
BETWEEN_NAMES = 0.07  # Inches.
EVERY = (1, 2, 3, *(6 * 2**power for power in range(16)))  # Steps are often months.
MAX_NAME = 14  # Letters of a step's name.


def named_steps(width: float, names: Sequence[str], figure: Figure) -> list[int]:
    """Places of the steps that are named: all where their names fit side by side into blocks of this width, inches;
    else every second, third, sixth, twelfth ... from the first."""
    longest = max(style.text_extent(figure, name, LETTERS)[0] for name in names) / figure.dpi
    every = next(one for one in EVERY if one * width >= longest + BETWEEN_NAMES)
    return list(range(0, len(names), every))


def draw_steps(
    figure: Figure, names: Sequence[str], colours: Sequence, left: float, bottom: float, width: float
) -> None:
    """Blocks of equal width in the colours of the steps, in order, with names below them.

    left, bottom: of the blocks, inches; width: of all blocks, inches.
    """
    across, down = figure.get_figwidth(), figure.get_figheight()
    block = width / len(names)
    for number, colour in enumerate(colours):
        figure.add_artist(
            Rectangle(
                ((left + number * block) / across, bottom / down), block / across, BLOCK_HEIGHT / down,
                facecolor=colour, edgecolor="white", linewidth=0.6 if block > 0.1 else 0.0,
                rasterized=style.are_many(names),
            )
        )  # fmt: skip
    short = [shortened(name) for name in names]
    for number in named_steps(block, short, figure):
        figure.text(
            (left + (number + 0.5) * block) / across, (bottom - 0.03) / down, short[number], ha="center", va="top",
            fontsize=LETTERS, color=style.OUTLINE, parse_math=False,
        )  # fmt: skip


def shortened(name: str) -> str:
    """A step's name as it fits into the key."""
    return name if len(name) <= MAX_NAME else name[: MAX_NAME - 1] + "…"
