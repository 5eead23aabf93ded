"""What differs between two programs, by meaning: which holes, by how much, and in what way."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from .events import Floats
from .made import MOVE_STEP, Made, Step
from .matching import Marks, Matcher, Rows
from .vectors import angle, aside, dot

#: What the strokes to the bottom are called, taken together.
PLUNGE = "plunge"


@dataclass(frozen=True)
class Tolerance:
    """Differences up to this much are rounding, not meaning."""

    length_mm: float = 0.002
    angle_rad: float = 1e-5
    share: float = 2e-3  # of speeds
    time_s: float = 1e-3


@dataclass(frozen=True)
class Change:
    """What differs at one hole. Lengths in mm, angles in degrees; None where nothing does.

    `moved_mm`: sideways; `deeper_mm`: along the axis; `tilted_deg`: of the axis; `turned_deg`: of
    the heading about it. `steps`: what is done otherwise, in words. `configuration`: before, after.
    """

    hole: str
    at: str
    moved_mm: float | None = None
    deeper_mm: float | None = None
    tilted_deg: float | None = None
    turned_deg: float | None = None
    steps: tuple[str, ...] = ()
    configuration: tuple[str, str] | None = None

    @property
    def any(self) -> bool:
        """Whether anything differs at all."""
        return self != Change(self.hole, self.at)


@dataclass(frozen=True)
class Difference:
    """`removed` and `added` are holes with their places; `order`: holes that change their turn."""

    before: int
    after: int
    removed: tuple[tuple[str, str], ...]
    added: tuple[tuple[str, str], ...]
    changed: tuple[Change, ...]
    order: tuple[str, ...]

    @property
    def none(self) -> bool:
        """Whether the two mean the same."""
        return not (self.removed or self.added or self.changed or self.order)


def difference(before: Made, after: Made, tolerance: Tolerance | None = None) -> Difference:
    """Compare two lists of holes: those of one name are the same hole where both sides have it,
    others are found by their place."""
    tolerance = tolerance or Tolerance()
    rows = _matched(before, after)
    gone = np.setdiff1d(np.arange(len(before)), rows)
    new = np.flatnonzero(rows < 0)
    kept = np.flatnonzero(rows >= 0)
    return Difference(
        len(before),
        len(after),
        tuple((before.names[i], before.place(i)) for i in gone.tolist()),
        tuple((after.names[i], after.place(i)) for i in new.tolist()),
        tuple(_changes(before, after, rows[kept], kept, tolerance)),
        tuple(after.names[i] for i in kept[_out_of_turn(rows[kept])].tolist()),
    )


def _matched(before: Made, after: Made) -> Rows:
    """For each hole of `after` its row in `before`, or -1."""
    row_of = {name: row for row, name in enumerate(before.names)}
    if len(row_of) == len(before) and len(set(after.names)) == len(after):
        rows = np.array([row_of.get(name, -1) for name in after.names], dtype=np.intp)
    else:
        rows = np.full(len(after), -1, dtype=np.intp)
    left, free = np.flatnonzero(rows < 0), np.setdiff1d(np.arange(len(before)), rows)
    if len(left) and len(free):
        wanted = Marks(before.bottom_mm[free], before.axis[free])
        found = Marks(after.bottom_mm[left], after.axis[left])
        again = Matcher(wanted).match(found, 0)
        # One place twice is one hole and another that is new.
        _, once = np.unique(again, return_index=True)
        again[np.setdiff1d(np.arange(len(again)), once)] = -1
        rows[left] = np.where(again < 0, -1, free[again])
    return rows


def _out_of_turn(rows: Rows) -> Rows:
    """The fewest that have to move so that the others are in order: those outside of a longest
    increasing run (patience sorting)."""
    if not len(rows):
        return rows
    tops: list[int] = []
    last: list[int] = []
    came_from = np.full(len(rows), -1, dtype=np.intp)
    for i, row in enumerate(rows.tolist()):
        k = int(np.searchsorted(tops, row)) if tops else 0
        came_from[i] = last[k - 1] if k else -1
        if k == len(tops):
            tops.append(row)
            last.append(i)
        else:
            tops[k], last[k] = row, i
    chain = []
    at = last[-1]
    while at >= 0:
        chain.append(at)
        at = int(came_from[at])
    return np.setdiff1d(np.arange(len(rows)), chain)


def _changes(before: Made, after: Made, old: Rows, new: Rows, tolerance: Tolerance) -> list[Change]:
    apart = after.bottom_mm[new] - before.bottom_mm[old]
    axis = before.axis[old]
    deeper = dot(apart, axis)
    beside = aside(apart, axis)
    tilt = angle(before.axis[old], after.axis[new])
    turn = _turn(before.rotation[old], after.rotation[new])
    one, two = before.configuration[old], after.configuration[new]
    both = np.isfinite(one).any(axis=1) & np.isfinite(two).any(axis=1)
    flipped = both & (np.nan_to_num(one, nan=-1.0) != np.nan_to_num(two, nan=-1.0)).any(axis=1)
    said: dict[tuple[int, int, float], tuple[str, ...]] = {}
    pairs = list(
        zip(
            before.steps[old].tolist(),
            after.steps[new].tolist(),
            np.round(deeper, 3).tolist(),
            strict=True,
        )
    )
    for pair in set(pairs):
        said[pair] = step_changes(
            before.step_lists[pair[0]], after.step_lists[pair[1]], tolerance, pair[2]
        )
    differs = np.array([bool(said[pair]) for pair in pairs], dtype=np.bool_)
    differs |= (beside > tolerance.length_mm) | (np.abs(deeper) > tolerance.length_mm)
    differs |= (tilt > tolerance.angle_rad) | (np.abs(turn) > tolerance.angle_rad) | flipped

    def beyond(value: float, limit: float, scale: float = 1.0) -> float | None:
        return scale * value if abs(value) > limit else None

    degrees = 180.0 / np.pi
    return [
        Change(
            hole=after.names[int(new[i])],
            at=after.place(int(new[i])),
            moved_mm=beyond(float(beside[i]), tolerance.length_mm),
            deeper_mm=beyond(float(deeper[i]), tolerance.length_mm),
            tilted_deg=beyond(float(tilt[i]), tolerance.angle_rad, degrees),
            turned_deg=beyond(float(turn[i]), tolerance.angle_rad, degrees),
            steps=said[pairs[i]],
            configuration=(_told(one[i]), _told(two[i])) if flipped[i] else None,
        )
        for i in np.flatnonzero(differs).tolist()
    ]


def _turn(one: Floats, two: Floats) -> Floats:
    """About the tool axis, from rotation `one` to `two` (n, 3, 3): of x, seen in one's frame."""
    x = np.einsum("nji,nj->ni", one, two[:, :, 0])
    return np.asarray(np.arctan2(x[:, 1], x[:, 0]))


def _told(configuration: Floats) -> str:
    return " ".join(f"{value:g}" for value in configuration.tolist() if not np.isnan(value))


# ── steps ────────────────────────────────────────────────────────────────────────────────────────


def step_changes(
    before: tuple[Step, ...],
    after: tuple[Step, ...],
    tolerance: Tolerance,
    deeper_mm: float = 0.0,
) -> tuple[str, ...]:
    """What is done otherwise, in words; where steps come or go, which. A hole that is `deeper_mm`
    deeper has its standoffs so much farther from its bottom: that is no other change."""
    before, after = _with_plunge(before), _with_plunge(after)
    if [step.what for step in before] != [step.what for step in after]:
        return tuple(_edits(before, after))
    words = []
    for one, two in zip(before, after, strict=True):
        limits = {
            "depth_mm": tolerance.length_mm,
            "speed_mm_s": tolerance.share * abs(one.speed_mm_s),
            "value": tolerance.share * abs(one.value),
            "timeout_s": tolerance.time_s,
        }
        for name, limit in limits.items():
            a, b = getattr(one, name), getattr(two, name)
            if name == "speed_mm_s" and (np.isnan(a) or np.isnan(b)):
                continue  # not stated, as on a way by joints
            if name == "depth_mm" and abs(b + deeper_mm - a) <= limit:
                continue
            if (np.isnan(a) != np.isnan(b)) or abs(a - b) > limit:
                shown = "pecks in mm" if one.what == PLUNGE and name == "value" else _SHOWN[name]
                words.append(f"{_called(one)}: {shown} {_number(a)} -> {_number(b)}")
    return tuple(dict.fromkeys(words))


def _with_plunge(steps: tuple[Step, ...]) -> tuple[Step, ...]:
    """The strokes to the bottom, with what lies between them, as one step that says how deep each
    peck is: a list of their moves tells nobody anything."""
    bottom = next((i for i, step in enumerate(steps) if step.depth_mm == 0.0), None)
    if bottom is None:
        return steps
    feed, deepest, strokes = steps[bottom].speed_mm_s, -np.inf, []
    for i, step in enumerate(steps[: bottom + 1]):
        if step.what == MOVE_STEP and step.depth_mm > deepest:
            deepest = step.depth_mm
            if i and step.speed_mm_s == feed:
                strokes.append(i)
    if not strokes or strokes[-1] != bottom:
        return steps
    first = strokes[0]
    peck = np.nan
    if len(strokes) > 1 and steps[first - 1].what == MOVE_STEP:
        peck = round(steps[first].depth_mm - steps[first - 1].depth_mm, 4)
    return (*steps[:first], Step(PLUNGE, 0.0, feed, peck), *steps[bottom + 1 :])


_SHOWN = {
    "depth_mm": "mm from the bottom",
    "speed_mm_s": "mm/s",
    "value": "value",
    "timeout_s": "time-out in s",
}


def _called(step: Step) -> str:
    if np.isnan(step.depth_mm):
        return step.what
    if step.what == PLUNGE:
        return "the plunge"
    return "the bottom" if step.depth_mm == 0.0 else f"the move to {-step.depth_mm:.3f} mm out"


def _number(value: float) -> str:
    return "none" if np.isnan(value) else f"{value:.6g}"


def _edits(before: tuple[Step, ...], after: tuple[Step, ...]) -> list[str]:
    """Steps that come or go, found as a text comparison finds lines."""
    from difflib import SequenceMatcher

    def key(step: Step) -> tuple[str, str]:
        return step.what, "" if np.isnan(step.depth_mm) else f"{step.depth_mm:.2f}"

    one, two = [key(step) for step in before], [key(step) for step in after]
    words = []
    for what, a, b, c, d in SequenceMatcher(None, one, two, autojunk=False).get_opcodes():
        if what != "equal":
            words += [f"no longer: {_called(step)}" for step in before[a:b]]
            words += [f"new: {_called(step)}" for step in after[c:d]]
    return words


# ── telling ──────────────────────────────────────────────────────────────────────────────────────

#: So many holes with one and the same change are named.
MOST_NAMED = 12


def as_text(found: Difference, before: str, after: str) -> str:
    """For a person: what all changed holes share is said once."""
    if found.none:
        return f"{before} and {after} mean the same: {_holes(found.after)}\n"
    lines = [f"{before} -> {after}: {found.before:,} -> {_holes(found.after)}"]
    for sign, word, holes in (("-", "removed", found.removed), ("+", "added", found.added)):
        if holes:
            lines.append(f"{word}: {len(holes):,}")
            lines += [f"  {sign} {name}  ({place})" for name, place in holes[:MOST_NAMED]]
            lines += _rest(len(holes))
    if found.changed:
        lines.append(f"changed: {len(found.changed):,}")
        lines += _extent(found.changed)
    groups: dict[tuple[str, ...], list[Change]] = {}
    for change in found.changed:
        groups.setdefault(_words(change), []).append(change)
    for words, changes in list(groups.items())[:MOST_NAMED]:
        names = ", ".join(change.hole for change in changes[:MOST_NAMED])
        more = f" and {len(changes) - MOST_NAMED:,} more" if len(changes) > MOST_NAMED else ""
        lines.append(f"  ~ {names}{more}  ({changes[0].at})")
        lines += [f"      {word}" for word in words]
    if len(groups) > MOST_NAMED:
        left = sum(len(changes) for changes in list(groups.values())[MOST_NAMED:])
        lines.append(f"    and {left:,} more, each by its own figures")
    if found.order:
        names = ", ".join(found.order[:MOST_NAMED])
        lines.append(f"out of turn: {len(found.order):,}: {names}")
        lines += _rest(len(found.order))
    return "\n".join(lines) + "\n"


def _holes(count: int) -> str:
    return f"{count:,} hole{'s' * (count != 1)}"


def as_json(found: Difference) -> dict[str, object]:
    """The same as plain data, nothing left out."""
    return {
        "same": found.none,
        "holes": [found.before, found.after],
        "removed": [{"hole": name, "at": place} for name, place in found.removed],
        "added": [{"hole": name, "at": place} for name, place in found.added],
        "changed": [asdict(change) for change in found.changed],
        "order": list(found.order),
    }


def _rest(count: int) -> list[str]:
    return [f"    and {count - MOST_NAMED:,} more"] if count > MOST_NAMED else []


def _extent(changed: tuple[Change, ...]) -> list[str]:
    """For figures that many holes have: how many, from what to what."""
    lines = []
    for name, said, unit in (
        ("moved_mm", "moved sideways", "mm"),
        ("deeper_mm", "deeper", "mm"),
        ("tilted_deg", "axis tilted", "deg"),
        ("turned_deg", "heading turned", "deg"),
    ):
        figures = [value for change in changed if (value := getattr(change, name)) is not None]
        if len(figures) > 1:
            ends = dict.fromkeys((f"{min(figures):.3f}", f"{max(figures):.3f}"))
            lines.append(f"  {said}: {len(figures):,} holes, by {' .. '.join(ends)} {unit}")
    return lines


def _words(change: Change) -> tuple[str, ...]:
    words = []
    if change.moved_mm is not None:
        words.append(f"moved sideways by {change.moved_mm:.3f} mm")
    if change.deeper_mm is not None:
        way = "deeper" if change.deeper_mm > 0 else "less deep"
        words.append(f"{abs(change.deeper_mm):.3f} mm {way}")
    if change.tilted_deg is not None:
        words.append(f"axis tilted by {change.tilted_deg:.4f} deg")
    if change.turned_deg is not None:
        words.append(f"heading turned by {change.turned_deg:.4f} deg")
    if change.configuration is not None:
        words.append(f"configuration {change.configuration[0]} -> {change.configuration[1]}")
    return (*words, *change.steps)
