"""treeX of pointtree: `tree_x_peer.py CLOUD.laz OUT.csv`. Its authors' preset for terrestrial clouds.

The package imports torch for an evaluation that is not used here, so an empty module stands for it. Heights are
those of the highest point of a tree over its lowest one.
"""

import csv
import importlib.machinery
import sys
from unittest import mock

for name in ("torch", "torch.nn", "torch.utils", "torch.utils.data", "torch_scatter"):
    empty = mock.MagicMock()
    empty.__spec__, empty.__path__ = importlib.machinery.ModuleSpec(name, None), []
    sys.modules[name] = empty

import laspy  # noqa: E402
import numpy as np  # noqa: E402
from pointtree.instance_segmentation import TreeXAlgorithm, TreeXPresetTLS  # noqa: E402


def main(cloud, out):
    read = laspy.read(cloud)
    points = np.column_stack([read.x, read.y, read.z]).astype(float)
    trees, places, diameters = TreeXAlgorithm(**{**TreeXPresetTLS(), "num_workers": 2})(points)
    with open(out, "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["x", "y", "dbh_m", "height_m"])
        for number, (place, diameter) in enumerate(zip(places, diameters)):
            own = points[trees == number, 2]
            table.writerow([*place, diameter, own.max() - own.min() if len(own) else ""])


if __name__ == "__main__":
    main(*sys.argv[1:])
