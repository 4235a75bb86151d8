"""What stands for what."""

import numpy as np

from ibe_rl.view import palette as colours


def test_expressions_go_from_blue_over_grey_to_orange() -> None:
    shades = colours.of_expressions(np.array([-1.0, 0.0, 1.0, -9.0, 0.5]))
    assert shades[:4].tolist() == [
        list(each) for each in (colours.NEGATIVE, colours.ZERO, colours.POSITIVE, colours.NEGATIVE)
    ]
    assert np.allclose(shades[4], (np.array(colours.ZERO) + colours.POSITIVE) / 2, atol=1)


def test_a_second_number_makes_them_darker_or_lighter() -> None:
    ways = np.array([[a, b] for a in (-1.0, 0, 1) for b in (-1.0, 0, 1)])
    shades = colours.of_expressions(ways).astype(int)
    assert np.array_equal(shades[1::3], colours.of_expressions(np.array([-1.0, 0, 1])))  # 0 leaves them as they are
    assert np.all(shades[0::3] < shades[1::3])
    assert np.all(shades[1::3] < shades[2::3])
    assert len(np.unique(shades, axis=0)) == 9
    assert np.array_equal(colours.of_expressions(np.c_[ways, np.ones(9)]), shades)  # a third one is not seen


def test_ids_keep_their_colours_and_neighbours_differ() -> None:
    shades = colours.of_clusters(np.arange(12))
    assert len(np.unique(shades, axis=0)) == 12
    assert np.array_equal(colours.of_clusters(np.array([12, 3])), shades[[0, 3]])


def test_letters_are_never_too_dark_and_keep_their_hue() -> None:
    shades = np.array([[20, 40, 80], [0, 0, 0], [200, 10, 10], [64, 144, 255]], np.uint8)
    letters = colours.legible(shades)
    assert letters[0].tolist() == [38, 75, 150]
    assert letters[1:].tolist() == shades[1:].tolist()
