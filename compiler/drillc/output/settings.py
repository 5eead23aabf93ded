"""The settings of an `emit` block, checked against what the post says it understands."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from drillc.language.diagnostics import Label, Report
from drillc.language.fields import did_you_mean
from drillc.language.job import Emit, Setting
from drillc.language.units import UNITS, said
from drillc.output.names import NameRules
from drillc.output.post import Option

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


def read_settings(
    options: Sequence[Option], rules: NameRules, emit: Emit, report: Report
) -> Mapping[str, Any]:
    """A value for every option: what the spec sets, else the default (also after an error)."""
    known = {option.name: option for option in options}
    values: dict[str, Any] = {option.name: option.default for option in options}
    first: dict[str, Setting] = {}
    for setting in emit.settings:
        name = setting.name.text
        option = known.get(name)
        if option is None:
            report.error(
                "E630",
                f"{emit.post.text} has no setting {name}",
                setting.name.span,
                hint=did_you_mean(name, known) or "it has no settings at all",
            )
        elif name in first:
            report.error(
                "E631",
                f"{name} is set twice",
                setting.span,
                labels=[Label(first[name].span, "first set here")],
            )
        elif (wrong := _wrong(option, setting, rules)) is None:
            value = setting.value
            values[name] = int(value) if option.kind == "count" else value
        else:
            code, message = wrong
            report.error(code, f"{name} {message}", setting.span, hint=_needed(option))
        first.setdefault(name, setting)
    return values


def _wrong(option: Option, setting: Setting, rules: NameRules) -> tuple[str, str] | None:
    """Code and message when the setting does not fit its option."""
    value = setting.value
    if option.kind in ("word", "name"):
        if not isinstance(value, str):
            return "E632", f"is a {option.kind}, not the number {_shown(value, setting.unit)}"
        if option.kind == "word" and value not in option.words:
            return "E633", f"cannot be {value!r}"
        if option.kind == "name":
            return _wrong_name(value, rules)
        return None
    if isinstance(value, str):
        return "E632", f"is a number, not {value!r}"
    if not math.isfinite(value):
        return "E632", "is no number that can be written"
    dimension = UNITS[setting.unit].dimension if setting.unit else None
    if dimension != option.dimension:
        wanted = said(option.dimension) if option.dimension else "a number without a unit"
        return "E632", f"is {wanted}, not {_shown(value, setting.unit)}"
    if option.kind == "count" and not float(value).is_integer():
        return "E632", f"is a whole number, not {value:g}"
    low = option.low if option.low is not None else float("-inf")
    high = option.high if option.high is not None else float("inf")
    if not low <= value <= high:
        return "E633", f"is {_shown(value, setting.unit)}, out of its range"
    return None


def _wrong_name(value: str, rules: NameRules) -> tuple[str, str] | None:
    if not _NAME.fullmatch(value):
        return "E633", f"is {value!r}: a name has letters, digits and _, and begins with a letter"
    if len(value) > rules.max_length:
        return "E633", f"is {len(value)} characters long; at most {rules.max_length} are taken"
    if rules.fold(value) in {rules.fold(word) for word in rules.keywords}:
        return "E633", f"is {value}, a word of the language"
    return None


def _shown(value: float | str, unit: str) -> str:
    """A base-unit value as one would write it in `unit`."""
    if not unit or isinstance(value, str):
        return f"{value:g}" if not isinstance(value, str) else value
    return f"{value / float(UNITS[unit].factor):.10g} {unit}"


_BASE = {
    "length": "mm",
    "angle": "deg",
    "time": "s",
    "speed": "mm/s",
    "spindle speed": "rpm",
    "turning speed": "deg/s",
    "feed per turn": "mm/rev",
    "force": "N",
    "mass": "kg",
    "share": "%",
}


def _needed(option: Option) -> str:
    """What one may write, in words."""
    if option.kind == "word":
        return f"one of: {', '.join(option.words)}"
    if option.kind == "name":
        return "a name on the controller"
    unit = _BASE[option.dimension] if option.dimension else ""
    what = "a whole number" if option.kind == "count" else "a number"
    if option.dimension:
        what = said(option.dimension)
    if option.low is not None and option.high is not None:
        return f"{what} from {_shown(option.low, unit)} to {_shown(option.high, unit)}"
    if option.low is not None:
        return f"{what}, {_shown(option.low, unit)} or more"
    if option.high is not None:
        return f"{what}, at most {_shown(option.high, unit)}"
    return what
