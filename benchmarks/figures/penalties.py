"""P3, Large-scale 3D Mapping of Subarctic Forests: figure 4."""

FIGURES = []
