"""Which figures there are. A figure names the runs that it needs and draws itself from them."""

from figures import flights, large_maps, penalties, strip_roads, walks


def all_figures():
    """By key, in the order of the papers."""
    made = [figure for module in (strip_roads, flights, large_maps, penalties, walks) for figure in module.FIGURES]
    order = lambda figure: (figure.key.split("-F")[0], int(figure.key.split("-F")[1]))
    return {figure.key: figure for figure in sorted(made, key=order)}
