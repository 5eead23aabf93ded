"""Names in RAPID: the words that are taken, what the program itself declares, and their check.

All data, routines, modules and signals of a task share one space of names, in any case of letters.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from drillc.language.diagnostics import NAMED_ROWS, Label, Report
from drillc.language.job import Signal
from drillc.language.source import Span
from drillc.output.acceptance import SPINDLE_ON, SPINDLE_RUNNING, SPINDLE_SPEED
from drillc.output.names import NameRules
from drillc.output.post import Task
from drillc.output.vias import plain_kinds
from drillc.planning.program import (
    Program,
    SetAnalog,
    StartSpindle,
    StopSpindle,
    SwitchOutput,
    WaitInput,
)

#: Data of an arm: its home, and numbered, the vias by joints and the straight ones.
HOME, BY_AXES, BY_LINE = "via_home", "via_axes_", "via_line_"

#: The work object that is declared where the spec says where the part stands.
PART_FRAME = "part_frame"

KEYWORDS = frozenset(
    """
    ALIAS AND BACKWARD CASE CONNECT CONST DEFAULT DIV DO ELSE ELSEIF ENDFOR ENDFUNC ENDIF ENDMODULE
    ENDPROC ENDRECORD ENDTEST ENDTRAP ENDWHILE ERROR EXIT FALSE FOR FROM FUNC GOTO IF INOUT LOCAL
    MOD MODULE NOSTEPIN NOT NOVIEW OR PERS PROC RAISE READONLY RECORD RETRY RETURN STEP SYSMODULE
    TASK TEST THEN TO TRAP TRUE TRYNEXT UNDO VAR VIEWONLY WHILE WITH XOR
    """.split()  # noqa: SIM905 (a table of words)
)
#: Data, types and routines that the system installs and that a program of holes might shadow, and
#: the names of the templates.
RESERVED = frozenset(
    """
    ABS ACCSET ACOS ARGNAME ASIN ATAN ATAN2 BOOL BREAK BYTE CALCJOINTT CALCROBT CJOINTT CLKRESET
    CLOCK CONFDATA CONFJ CONFL COS CPOS CROBT DIGIP DINUM DNUM EOF ERRNO ERR_WAIT_MAXTIME
    ERRNUM EXITCYCLE EXTJOINT FINE GRIPLOAD INCR DECR INPOS INTNUM JOINTTARGET LOAD0 LOADDATA MAIN
    MOVEABSJ MOVEC MOVEJ MOVEL NUM NUMTOSTR OFFS ORIENT ORIENTZYX PI POS POSE POSEINV POSEMULT
    POW PRESENT PULSEDO RELTOOL RESET ROBJOINT ROBTARGET ROUND SEARCHL SET SETAO SETDO SETGO
    SHAPEDATA SIGNALAI SIGNALAO SIGNALDI SIGNALDO SIGNALGI SIGNALGO SIN SINGAREA SPEEDDATA SQRT
    STOP STOPPOINTDATA STRING TAN TOOL0 TOOLDATA TPERASE TPREADFK TPWRITE TRIGGDATA VELSET VMAX
    WAITAI WAITDI WAITDO WAITTIME WAITUNTIL WOBJ0 WOBJDATA WZSTATIONARY WZTEMPORARY ZONEDATA
    V5 V10 V20 V30 V40 V50 V60 V80 V100 V150 V200 V300 V400 V500 V600 V800 V1000 V1500 V2000 V2500
    V3000 V4000 V5000 V6000 V7000 Z0 Z1 Z5 Z10 Z15 Z20 Z30 Z40 Z50 Z60 Z80 Z100 Z150 Z200
    AT BOTTOM DEPTH HOLE NOW PART_FRAME STANDOFF TIMEOUT WITHDRAW
    """.split()  # noqa: SIM905 (a table of words)
)
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")

RULES = NameRules(max_length=32, keywords=KEYWORDS, reserved=RESERVED)


def signal_name(signal: Signal) -> str:
    """What the controller calls a signal."""
    return signal.alias or signal.role


def tool_name(task: Task) -> str:
    if task.settings["tooldata"]:
        return str(task.settings["tooldata"])
    if task.program.tool is None:
        return "tool0"
    return RULES.mapped([task.program.tool.name.text], "process")[0]


def wobj_name(task: Task) -> str:
    if task.settings["wobjdata"]:
        return str(task.settings["wobjdata"])
    return "wobj0" if task.program.frame is None else PART_FRAME


@dataclass(frozen=True)
class _Own:
    """A name that the text uses beside those of the holes, processes and modules."""

    name: str
    what: str
    span: Span


def _own_names(task: Task) -> Iterator[_Own]:
    span = task.emit.post.span
    if task.program.tool is not None or task.settings["tooldata"]:
        tool = task.program.tool
        own_span = tool.name.span if tool and not task.settings["tooldata"] else span
        yield _Own(tool_name(task), "the tool", own_span)
    if task.settings["wobjdata"]:
        yield _Own(wobj_name(task), "the work object", span)
    if len(task.names.modules) > 1:
        for index in range(len(task.names.modules)):
            yield _Own(f"holes_{index + 1}", "a procedure of the program", span)
    if task.program.arm is not None:
        yield _Own(HOME, "the arm's home", span)
        for kind, name in (("joints", BY_AXES), ("straight", BY_LINE)):
            for number in range(np.count_nonzero(plain_kinds(task.program.arm) == kind)):
                yield _Own(f"{name}{number + 1}", "a way to a hole", span)
    for signal in _signals_used(task.program):
        yield _Own(signal_name(signal), f"the signal {signal.role}", signal.span)


def _settings_names(task: Task) -> list[str]:
    return [task.settings[key] for key in ("tooldata", "wobjdata") if task.settings[key]]


def _signals_used(program: Program) -> list[Signal]:
    roles: set[str] = set()
    for cycle in program.cycles:
        for step in (*cycle.steps, *cycle.fault):
            match step:
                case SwitchOutput(role=role) | SetAnalog(role=role) | WaitInput(role=role):
                    roles.add(role)
                case StartSpindle() | StopSpindle():
                    roles.update((SPINDLE_ON, SPINDLE_SPEED, SPINDLE_RUNNING))
    return [signal for role, signal in program.signals.items() if role in roles]


def check_names(task: Task, report: Report) -> None:
    """Every name must be one that RAPID reads, and mean one thing: a robtarget that is called like
    a signal hides the signal from its module."""
    rules, names, program = RULES, task.names, task.program
    words = {rules.fold(word) for word in rules.keywords}
    taken = {rules.fold(word): ("a name that RAPID or the program uses", None) for word in RESERVED}
    spoken: dict[str, tuple[str, Span | None]] = {**taken}
    for routine, cycle in zip(names.processes, program.cycles, strict=False):
        place = cycle.process.span
        spoken[rules.fold(routine)] = (f"process {cycle.process.name}", place)
    for module in (names.program, *names.modules):
        spoken[rules.fold(module)] = ("a module of the program", None)
    found: dict[str, _Own] = {}
    for own in _own_names(task):
        fold = rules.fold(own.name)
        if fold in ("tool0", "wobj0") and fold in map(rules.fold, _settings_names(task)):
            continue
        wrong = ""
        if not _NAME.fullmatch(own.name):
            wrong = "a name has letters, digits and _, and begins with a letter"
        elif len(own.name) > rules.max_length:
            wrong = f"it has {len(own.name)} characters; {rules.max_length} are taken"
        elif fold in words:
            wrong = "it is a word of the language"
        if wrong:
            report.error(
                "E647",
                f"{own.what} cannot be called {own.name} in rapid: {wrong}",
                own.span,
                hint="give it another name; io takes an alias for a signal",
            )
        elif other := spoken.get(fold):
            _report_shared(own, other[0], other[1], report)
        elif (twin := found.get(fold)) and twin.what != own.what:
            _report_shared(own, twin.what, twin.span, report)
        found.setdefault(fold, own)
    if names.holes is None or not len(names.holes):
        return
    rows = np.flatnonzero(np.isin(np.char.lower(names.holes), list(found)))
    for row in rows[:NAMED_ROWS].tolist():
        own = found[rules.fold(str(names.holes[row]))]
        _report_shared(own, f"hole {program.holes.ids[row]}", program.holes.span(row), report)
    if len(rows) > NAMED_ROWS:
        report.error("E647", f"{len(rows) - NAMED_ROWS} more holes with such names")


def _report_shared(own: _Own, other: str, place: Span | None, report: Report) -> None:
    report.error(
        "E647",
        f"{own.what} and {other} are both called {own.name} in rapid",
        own.span,
        labels=[Label(place, other)] if place else [],
        hint="rename one of them; io takes an alias for a signal",
    )
