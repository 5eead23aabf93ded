"""Resolving `sequence { … }`: the order of the holes, and what is weighed against what."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

from drillc.language.ast import Item, Quantity, Statement, Word
from drillc.language.diagnostics import Label, Report
from drillc.language.fields import Fields, entries, measure, of_type
from drillc.language.job import Weights

#: The names of the weights.
WEIGHTS = tuple(field.name for field in fields(Weights))
#: The greatest weight.
MAX_WEIGHT = 1_000_000


@dataclass(frozen=True)
class Order:
    """What `sequence` says: see `Job`."""

    shortest: bool
    heading_jump_max_rad: float | None
    weights: Weights


def resolve_sequence(found: Sequence[Statement], report: Report) -> Order:
    """`sequence { order given|shortest  heading_jump max A  weights { … } }`."""
    for statement in found[1:]:
        report.error(
            "E215",
            "a spec has one sequence; this is another",
            statement.name.span,
            labels=[Label(found[0].name.span, "the first one")],
            hint="put everything into one of them",
        )
    if not found:
        return Order(False, None, Weights())
    items = Fields(found[0], report)
    order = items.get("order")
    return Order(
        order is not None and of_type(order.values[0], Word).text == "shortest",
        _jump(items.get("heading_jump"), report),
        _weights(items.get("weights"), report),
    )


def _jump(item: Item | None, report: Report) -> float | None:
    if item is None:
        return None
    most = of_type(item.values[0], Quantity)
    jump = measure(most, "angle", "heading_jump", report, above=0)
    if jump > math.pi:
        report.error(
            "E206",
            f"heading_jump is {most.number} {most.unit}; it must be at most 180 deg, as far as any "
            "heading jumps",
            most.span,
        )
    return jump


def _weights(item: Item | None, report: Report) -> Weights:
    stated = {}
    for name, entry in entries(item, WEIGHTS, "weight", report).items():
        written = of_type(entry.values[0], Quantity)
        weight = float(written.number)
        if not 0 <= weight <= MAX_WEIGHT:
            report.error(
                "E207",
                f"the weight of {name} is {written.number[:24]}; it must be from 0 to "
                f"{MAX_WEIGHT:,}",
                written.span,
            )
            continue
        stated[name] = weight
    return Weights(**stated)
