"""Job → Job with the holes of each region in a short order, where `sequence { order shortest }`."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from drillc.kernels.tour import short_tour
from drillc.language.job import ExpectCount, HoleTable, Job

Rows = NDArray[np.int64]


def in_order(job: Job) -> Job:
    """The same job, its holes in the order in which they are made: as given, or by short tours
    within the regions. The regions keep their order."""
    if not job.order_shortest:
        return job
    order = np.arange(len(job.holes))
    for region in job.regions:
        rows = slice(region.start, region.stop)
        order[rows] = region.start + short_tour(job.holes.position_mm[rows])
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    expects = tuple(
        expect if isinstance(expect, ExpectCount) else replace(expect, row=int(place[expect.row]))
        for expect in job.expects
    )
    return replace(job, holes=take(job.holes, order), expects=expects)


def take(holes: HoleTable, rows: Rows) -> HoleTable:
    """Some rows of the table, in the order given."""
    columns = {f.name: getattr(holes, f.name)[rows] for f in fields(holes) if f.name != "sources"}
    return HoleTable(**columns, sources=holes.sources)
