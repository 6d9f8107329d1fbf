"""The runs of the three strip roads: figures 9 and 10 of P1 are drawn from them, and table 1 is measured on them.
Python standard library only."""

from figures.runs import Job, Recording, settings

ROADS = ("lieksa1", "lieksa2", "lieksa3")
# The paper's names, and the arguments of `understory map`. The second keeps its map of all points, in which the stems of
# table 1 are found.
WAYS = {"stems": ("by stems (sSLAM)", ("--front-end", "sparse")),
        "loam": ("LOAM with ground (LLOAM)", settings("registration.method=loam_ground", "loop_closure.enabled=false"))}


def road_job(recording, way):
    return Job(recording, way, WAYS[way][1])


def road_jobs_of(roads, seed, seconds=None):
    """{(road, way): job}; `seconds`: only so much of each road."""
    return {(road, way): road_job(Recording(road, seed, seconds), way) for road in roads for way in WAYS}
