"""The kinds of fault, a table for each language. What a shop, a typing finger or a bug can do."""

from __future__ import annotations

import re

from mutants.editing import (
    Fault,
    any_of,
    commented,
    digit,
    doubled,
    dropped,
    exchanged,
    put_before,
    replaced,
    sign,
    swapped_groups,
    swapped_lines,
    word,
)

# ── what of a line is no comment ─────────────────────────────────────────────────────────────────


def krl_code(line: str) -> str:
    return re.match(r'(?:[^";]|"[^"]*")*', line).group()  # type: ignore[union-attr]


def rapid_code(line: str) -> str:
    return re.match(r'(?:[^"!]|"[^"]*")*', line).group()  # type: ignore[union-attr]


def gcode_code(line: str) -> str:
    """Comments blanked out, so that columns stay."""
    return re.sub(r"\([^)]*\)", lambda match: " " * len(match.group()), line.split(";")[0])


# ── KRL ──────────────────────────────────────────────────────────────────────────────────────────

_N = r"(?P<x>-?\d+\.\d+)"
_POSITION = r"^DECL (?:GLOBAL )?E6POS "
_CALL = r"^  (?!PTP|LIN|END|DECL|BAS|WAIT|IF|LOOP)[A-Za-z_]\w*\([A-Za-z_]\w*.*\)"
_IN_ROUTINE = r"^  +(?:LIN|PTP|WAIT|\$OUT|\$ANOUT|AT|BOTTOM|\$VEL|\$TIMER|HALT|MsgNotify)\b.*"
SRC, DAT = r"\.src$", r"\.dat$"

KRL: dict[str, Fault] = {
    "digit of a position": digit(rf"(?<=[XYZ] ){_N}", DAT, _POSITION),
    "last digit of a position": digit(rf"(?<=[XYZ] ){_N}", DAT, _POSITION, last=True),
    "sign of a position": sign(rf"(?<=[XYZ] ){_N}", DAT, _POSITION),
    "digit of an angle": digit(rf"(?<=[ABC] ){_N}", DAT, _POSITION),
    "sign of an angle": sign(rf"(?<=[ABC] ){_N}", DAT, _POSITION),
    "X and Y swapped": swapped_groups(rf"{_POSITION}.*X (?P<a>[-\d.]+),Y (?P<b>[-\d.]+)", DAT),
    "Y and Z swapped": swapped_groups(rf"{_POSITION}.*Y (?P<a>[-\d.]+),Z (?P<b>[-\d.]+)", DAT),
    "A and C swapped": swapped_groups(rf"{_POSITION}.*A (?P<a>[-\d.]+),B .*C (?P<b>[-\d.]+)", DAT),
    "A and B swapped": swapped_groups(rf"{_POSITION}.*A (?P<a>[-\d.]+),B (?P<b>[-\d.]+)", DAT),
    "status S": digit(r"VIA_PTP.*,S (?P<x>\d)", DAT),
    "turn T": digit(r"VIA_PTP.*,T (?P<x>\d+)", DAT),
    "two holes with each other's values": exchanged(rf"{_POSITION}\w+=(?P<x>\{{.*\}})", DAT),
    "digit of a via": digit(rf"(?<= ){_N}", DAT, r"^VIA_\w+\[\d+\]="),
    "digit of home": digit(rf"(?<= ){_N}", DAT, r"VIA_HOME="),
    "digit of a standoff": digit(rf"STANDOFF\[\d+\]=.*Z {_N}", DAT),
    "sign of a standoff": sign(rf"STANDOFF\[\d+\]=.*Z {_N}", DAT),
    "a name of 25 characters": word(rf"{_POSITION}(?P<x>\w+)=", "P" * 25, DAT),
    "a hole declared under another name": word(rf"{_POSITION}(?P<x>\w+)=", "ELSEWHERE", DAT),
    "a hole declared twice": doubled(_POSITION, DAT),
    "a hole not declared": dropped(_POSITION, DAT),
    "decimal comma": word(r"(?<=\d)(?P<x>\.)(?=\d)", ",", DAT, _POSITION),
    "a component missing": word(rf"{_POSITION}.*(?P<x>,Y [-\d.]+)", "", DAT),
    "another type": word(r"^DECL (?:GLOBAL )?(?P<x>E6POS) \w+=", "E6AXIS", DAT),
    "no ENDDAT": dropped(r"^ENDDAT", DAT),
    "wrong tool": digit(r"BAS\(#TOOL,(?P<x>\d+)\)", SRC),
    "wrong base": digit(r"BAS\(#BASE,(?P<x>\d+)\)", SRC),
    "digit of the tool": digit(rf"(?<=[XYZABC] ){_N}", SRC, "TOOL_DATA"),
    "digit of the base": digit(rf"(?<=[XYZABC] ){_N}", SRC, "BASE_DATA"),
    "no base": dropped(r"BAS\(#BASE", SRC),
    "no tool": dropped(r"BAS\(#TOOL", SRC),
    "holes swapped": swapped_lines(_CALL, SRC),
    "a hole dropped": dropped(_CALL, SRC),
    "a hole commented out": commented(_CALL, "; ", path=SRC),
    "a hole doubled": doubled(_CALL, SRC),
    "depth of a hole": digit(rf"(?<=,){_N}\)", SRC, _CALL),
    "a routine's name": word(r"^  (?P<x>drill\w+|skin\w+|lap\w+|csk\w+)\(", "nothing", SRC),
    "PTP for LIN": word(r"^ +(?P<x>LIN) ", "PTP", SRC),
    "LIN for PTP": word(r"^  +(?P<x>PTP) VIA_PTP", "LIN", SRC),
    "a way dropped": dropped(r"^  (?:PTP|LIN) (?:VIA|\w+:STANDOFF)", SRC),
    "home dropped": dropped(r"^  PTP (?:VIA_HOME|\$H_POS)", SRC),
    "a move of the routine dropped": dropped(r"^  +LIN HOLE:", SRC),
    "a line of the routine dropped": dropped(_IN_ROUTINE, SRC),
    "a line of the routine commented out": commented(_IN_ROUTINE, "; ", path=SRC),
    "a line of the routine doubled": doubled(r"^  +(?:LIN|\$OUT|\$ANOUT|WAIT FOR).*", SRC),
    "lines of the routine swapped": swapped_lines(r"^  +(?:LIN|\$OUT|\$ANOUT|WAIT FOR|AT\.Z)", SRC),
    "digit of a speed": digit(r"\$VEL\.CP=(?P<x>[\d.]+)", SRC),
    "a speed in mm/s": replaced(
        r"\$VEL\.CP=(?P<x>[\d.]+)", lambda m, rng: f"{float(m['x']) * 1000:.3f}", SRC
    ),
    "digit of a place in the routine": digit(rf"AT\.Z=(?:BOTTOM)?{_N}", SRC),
    "sign of a place in the routine": sign(rf"AT\.Z={_N}", SRC),
    "digit of a peck": digit(r"BOTTOM\+(?P<x>[\d.]+)", SRC),
    "a comparison turned": word(r"WHILE .*(?P<x><)", ">", SRC),
    "TRUE and FALSE": replaced(
        r"\$OUT\[\d+\]=(?P<x>TRUE|FALSE)",
        lambda m, rng: "FALSE" if m["x"] == "TRUE" else "TRUE",
        SRC,
    ),
    "another output": digit(r"\$OUT\[(?P<x>\d+)\]", SRC),
    "another input": digit(r"\$IN\[(?P<x>\d+)\]", SRC),
    "an analog value": digit(r"\$ANOUT\[\d+\]=(?P<x>\d+\.\d+)", SRC),
    "a handshake dropped": dropped(r"WAIT FOR", SRC),
    "a handshake without an end": word(r"WAIT FOR \$IN\[\d+\](?P<x> OR \S+)", "", SRC),
    "a time-out": digit(r"\$TIMER\[\d+\]=-(?P<x>\d+)", SRC),
    "a timer that does not run": word(r"\$TIMER_STOP\[\d+\]=(?P<x>FALSE)", "TRUE", SRC),
    "a dwell": digit(r"WAIT SEC (?P<x>\d+\.\d+)", SRC),
    "an extra dwell": put_before(r"^  +LIN HOLE:AT", "  WAIT SEC 1.500", SRC),
    "an extra output": put_before(r"^  +LIN HOLE:", "  $OUT[99]=TRUE", SRC),
    "the fault goes on": dropped(r"^ +HALT", SRC),
    "no END": dropped(r"^END\b", SRC),
    "no ENDIF": dropped(r"^ +ENDIF", SRC),
    "no ENDWHILE": dropped(r"^ +ENDWHILE", SRC),
    "a word that is none": word(r"^  +(?P<x>LIN) ", "LINN", SRC),
    "a bracket too few": word(r"^  \w+\(\w+.*(?P<x>\))", "", SRC),
    "an umlaut in a name": word(r"^  \w+\((?P<x>\w)\w*", "Ü", SRC),
}

# ── RAPID ────────────────────────────────────────────────────────────────────────────────────────

MOD = r"\.mod$"
_TARGET = r"robtarget (?!via)\w+:="
_JOINTS = r"jointtarget (?!via)\w+:="
_R_CALL = r"^    (?!Move|Set|Wait|IF|ENDIF|VAR|TPWrite|Conf|EXIT|holes_)[A-Za-z]\w* [A-Za-z]\w*.*;"
#: Each coordinate of a target's position, each part of its quaternion, each of its configuration.
_PLACES = [rf"{_TARGET}\[\[(?:[-\d.]+,){{{k}}}{_N}" for k in range(3)]
_PARTS = [rf"{_TARGET}\[\[[-\d.,]+\],\[(?:[-\d.]+,){{{k}}}{_N}" for k in range(4)]
_CONFIGURATION = [rf"\],\[(?:-?\d,){{{k}}}(?P<x>-?\d)[-\d,]*\],\[9E" for k in range(4)]
_QUATERNION = r"\],\[(?P<a>-?[\d.]+),(?P<b>-?[\d.]+),-?[\d.]+,-?[\d.]+\]"
_R_ROUTINE = r"^    +(?:MoveL|SetDO|SetAO|WaitDI|WaitTime|bottom:=|TPWrite|EXIT)\b.*"

RAPID: dict[str, Fault] = {
    "digit of a position": any_of(*(digit(place, MOD) for place in _PLACES)),
    "last digit of a position": any_of(*(digit(place, MOD, last=True) for place in _PLACES)),
    "sign of a position": any_of(*(sign(place, MOD) for place in _PLACES)),
    "digit of an axis": digit(rf"(?<=[\[,]){_N}", MOD, _JOINTS),
    "X and Y swapped": swapped_groups(rf"{_TARGET}\[\[(?P<a>[-\d.]+),(?P<b>[-\d.]+)", MOD),
    "Y and Z swapped": swapped_groups(rf"{_TARGET}\[\[[-\d.]+,(?P<a>[-\d.]+),(?P<b>[-\d.]+)", MOD),
    "digit of a quaternion": any_of(*(digit(part, MOD) for part in _PARTS)),
    "sign in a quaternion": any_of(*(sign(part, MOD) for part in _PARTS)),
    "scalar last in a quaternion": replaced(
        rf"{_TARGET}\[\[[-\d.,]+\],\[(?P<x>[-\d.,]+)\]",
        lambda m, rng: ",".join([*m["x"].split(",")[1:], m["x"].split(",")[0]]),
        MOD,
    ),
    "quaternion parts swapped": swapped_groups(rf"{_TARGET}\[\[[-\d.,]+{_QUATERNION}", MOD),
    "three parts of a quaternion": word(
        rf"{_TARGET}\[\[[-\d.,]+\],\[[-\d.]+(?P<x>,[-\d.]+)", "", MOD
    ),
    "two holes with each other's values": exchanged(rf"{_TARGET}(?P<x>\[.*\])", MOD),
    "configuration": any_of(*(digit(part, MOD, "robtarget") for part in _CONFIGURATION)),
    "digit of a via": digit(rf"(?<=[\[,]){_N}", MOD, r"target via_\w+:="),
    "digit of a standoff": digit(rf"standoff\{{\d+\}}:=\[(?:[-\d.]+,)*{_N}", MOD),
    "sign of a standoff": sign(rf"standoff\{{\d+\}}:=\[(?:[-\d.]+,)*{_N}", MOD),
    "a name of 33 characters": word(r"CONST robtarget (?P<x>\w+):=", "P" * 33, MOD),
    "a hole declared under another name": word(
        r"CONST (?:robtarget|jointtarget) (?!via)(?P<x>\w+):=", "elsewhere", MOD
    ),
    "a hole declared twice": doubled(r"CONST (?:robtarget|jointtarget) ", MOD),
    "a hole not declared": dropped(r"CONST (?:robtarget|jointtarget) ", MOD),
    "decimal comma": word(r"(?<=\d)(?P<x>\.)(?=\d)", ",", MOD, "robtarget|jointtarget"),
    "another type": word(r"CONST (?P<x>robtarget) ", "jointtarget", MOD),
    "no semicolon": word(r"(?P<x>;)\r?$", "", MOD),
    "no ENDMODULE": dropped(r"^ENDMODULE", MOD),
    "no ENDPROC": dropped(r"^  ENDPROC", MOD),
    "no ENDIF": dropped(r"^ +ENDIF", MOD),
    "another module name": word(r"^MODULE (?P<x>\w+)", "SOMETHING", MOD),
    "wrong tool": word(r"fine,(?P<x>\w+)", "tool0", MOD),
    "wrong work object": word(r"\\WObj:=(?P<x>\w+)", "wobj0", MOD),
    "no work object": word(r"(?P<x>\\WObj:=\w+)", "", MOD),
    "digit of the tool": digit(rf"(?<=[\[,]){_N}", MOD, "tooldata.*:="),
    "digit of the work object": digit(rf"(?<=[\[,]){_N}", MOD, "wobjdata.*:="),
    "holes swapped": swapped_lines(_R_CALL, MOD),
    "a hole dropped": dropped(_R_CALL, MOD),
    "a hole commented out": commented(_R_CALL, "! ", path=MOD),
    "a hole doubled": doubled(_R_CALL, MOD),
    "depth of a hole": digit(rf"^    [A-Za-z]\w* [A-Za-z]\w*,{_N};", MOD),
    "a module not called": dropped(r"^    holes_\d+;", MOD),
    "MoveJ for MoveL": word(r"^ +(?P<x>MoveL) RelTool", "MoveJ", MOD),
    "a way dropped": dropped(r"^    (?:MoveJ|MoveAbsJ|MoveL via)", MOD),
    "a move of the routine dropped": dropped(r"^    +Move\w+ RelTool\(hole", MOD),
    "a line of the routine dropped": dropped(_R_ROUTINE, MOD),
    "a line of the routine commented out": commented(_R_ROUTINE, "! ", path=MOD),
    "a line of the routine doubled": doubled(r"^    +(?:SetDO|SetAO|WaitDI|MoveL).*", MOD),
    "lines of the routine swapped": swapped_lines(r"^    +(?:SetDO|SetAO|WaitDI|MoveL)", MOD),
    "a zone for fine": word(r"^ +MoveL RelTool.*,(?P<x>fine),", "z50", MOD),
    "digit of a speed": digit(r"\\V:=(?P<x>[\d.]+)", MOD),
    "a speed in m/s": replaced(
        r"\\V:=(?P<x>[\d.]+)", lambda m, rng: f"{float(m['x']) / 1000:.3f}", MOD
    ),
    "digit of a place in the routine": digit(rf"RelTool\(hole,0,0,{_N}", MOD),
    "a place sideways": word(r"RelTool\(hole,(?P<x>0),", "1", MOD),
    "sign of a place in the routine": sign(rf"RelTool\(hole,0,0,{_N}", MOD),
    "digit of a peck": digit(r"bottom\+(?P<x>[\d.]+)", MOD),
    "on and off": replaced(r"SetDO \w+,(?P<x>[01])", lambda m, rng: "10"[int(m["x"])], MOD),
    "another output": word(r"SetDO (?P<x>\w+)", "other", MOD),
    "another input": word(r"WaitDI (?P<x>\w+)", "other", MOD),
    "an input that goes": word(r"WaitDI \w+,(?P<x>1)", "0", MOD),
    "an analog value": digit(r"SetAO \w+,(?P<x>\d+\.\d+)", MOD),
    "a handshake dropped": dropped(r"WaitDI", MOD),
    "a handshake without an end": word(r"WaitDI \w+,1(?P<x>\\MaxTime\S+?);", "", MOD),
    "a time-out": digit(r"MaxTime:=(?P<x>[\d.]+)", MOD),
    "a dwell": digit(r"WaitTime (?P<x>[\d.]+)", MOD),
    "an extra dwell": put_before(r"^    +MoveL RelTool", "    WaitTime 1.5;", MOD),
    "an extra output": put_before(r"^    +MoveL RelTool", "    SetDO other,1;", MOD),
    "the fault goes on": dropped(r"^ +EXIT;", MOD),
    "a word that is none": word(r"^ +(?P<x>MoveL) ", "MoveX", MOD),
    "a module not listed": dropped(r"<Module>", r"\.pgf$"),
}

# ── G-code ───────────────────────────────────────────────────────────────────────────────────────

NGC = r"\.ngc$"
_G_MOVE = r"^G[01] (?:[XYZABCUVW][-\d.]+ ?)+"
_G_CALL = r"^o<(?!\w+_\d+>)\w+> call"
_G_ROUTINE = r"^  +(?:G[014]|M6[0-9]|M[0-9]).*"

GCODE: dict[str, Fault] = {
    "digit of an axis": digit(rf"(?<=[XYZABCUVW]){_N}", NGC, r"^G[01] "),
    "last digit of an axis": digit(rf"(?<=[XYZABCUVW]){_N}", NGC, r"^G[01] ", last=True),
    "sign of an axis": sign(rf"(?<=[XYZABCUVW]){_N}", NGC, r"^G[01] "),
    "axes swapped": swapped_groups(r"^G[01] .*?(?P<a>[XYZABCUVW])[-\d.]+ (?P<b>[XYZABCUVW])", NGC),
    "an axis left out": word(r"(?P<x> [XYZABCUVW][-\d.]+)", "", NGC, r"^G[01] "),
    "values of two axes swapped": swapped_groups(
        r"^G[01] .*?[XYZABCUVW](?P<a>[-\d.]+) [XYZABCUVW](?P<b>[-\d.]+)", NGC
    ),
    "digit of an argument": digit(rf"(?<=\[){_N}\]", NGC, _G_CALL),
    "sign of an argument": sign(rf"(?<=\[){_N}\]", NGC, _G_CALL),
    "an argument left out": word(r"(?P<x> \[[-\d.]+\])", "", NGC, _G_CALL),
    "G20 for G21": word(r"(?P<x>G21)\b", "G20", NGC),
    "G91 for G90": word(r"(?P<x>G90)\b", "G91", NGC),
    "G95 for G94": word(r"(?P<x>G94)\b", "G95", NGC),
    "G64 for G61": word(r"(?P<x>G61)\b", "G64", NGC),
    "no units": word(r"(?P<x>G21 )", "", NGC),
    "no distance mode": word(r"(?P<x>G90 )", "", NGC),
    "another origin": word(r"(?P<x>G54)\b", "G55", NGC),
    "a tool length": word(r"(?P<x>G49)\b", "G43", NGC),
    "the first line dropped": dropped(r"^G21", NGC),
    "no end": dropped(r"^M2\b", NGC),
    "holes swapped": swapped_lines(_G_CALL, NGC),
    "a hole dropped": dropped(_G_CALL, NGC),
    "a hole commented out": commented(_G_CALL, "(", ")", NGC),
    "a hole doubled": doubled(_G_CALL, NGC),
    "a way dropped": dropped(_G_MOVE, NGC),
    "ways swapped": swapped_lines(_G_MOVE, NGC),
    "a routine's name": word(r"^o<(?P<x>\w+)> call", "nothing", NGC),
    "a file not called": dropped(r"^o<\w+_\d+> call", NGC),
    "a move of the routine dropped": dropped(r"^  +G[01] ", NGC),
    "a line of the routine dropped": dropped(_G_ROUTINE, NGC),
    "a line of the routine commented out": commented(_G_ROUTINE, "(", ")", NGC),
    "a line of the routine doubled": doubled(r"^  +M6[4568] .*", NGC),
    "lines of the routine swapped": swapped_lines(r"^  +(?:G[01]|M6[4568]) ", NGC),
    "G0 for G1": word(r"^ +(?P<x>G1) ", "G0", NGC),
    "G1 for G0": word(r"^(?P<x>G0) ", "G1", NGC),
    "digit of a feed": digit(r"F(?P<x>[\d.]+)", NGC),
    "a feed in mm/s": replaced(r"F(?P<x>[\d.]+)", lambda m, rng: f"{float(m['x']) / 60:.3f}", NGC),
    "no feed": word(r"(?P<x> F[\d.]+)", "", NGC),
    "digit of a place in the routine": digit(rf"\[#\d+ [-+] {_N}\]", NGC),
    "sign of a place in the routine": replaced(
        r"\[#\d+ (?P<x>[-+]) ", lambda m, rng: "+" if m["x"] == "-" else "-", NGC
    ),
    "another parameter": digit(r"\[?#(?P<x>\d)(?!\d)", NGC),
    "on and off": replaced(
        r"^ +(?P<x>M64|M65) ", lambda m, rng: "M65" if m["x"] == "M64" else "M64", NGC
    ),
    "another output": digit(r"M6[45] P(?P<x>\d+)", NGC),
    "another input": digit(r"M66 P(?P<x>\d+)", NGC),
    "waiting for off": word(r"M66 P\d+ L(?P<x>3)", "4", NGC),
    "no waiting": word(r"M66 P\d+ L(?P<x>3)", "0", NGC),
    "a time-out": digit(r"M66 .*Q(?P<x>[\d.]+)", NGC),
    "an analog value": digit(r"M68 E\d+ Q(?P<x>\d+\.\d+)", NGC),
    "a handshake dropped": dropped(r"^ +M66 ", NGC),
    "the answer not looked at": word(r"if \[#5399 EQ (?P<x>-1)\]", "-2", NGC),
    "a dwell": digit(r"G4 P(?P<x>[\d.]+)", NGC),
    "an extra dwell": put_before(r"^ +G1 ", "  G4 P1.5", NGC),
    "an extra output": put_before(r"^ +G1 ", "  M64 P9", NGC),
    "the fault goes on": dropped(r"^ +M2\b", NGC),
    "no endif": dropped(r"^ +o\d+ endif", NGC),
    "no endsub": dropped(r"^o<\w+> endsub", NGC),
    "a word that is none": word(r"^ +(?P<x>G1) ", "G999", NGC),
    "an exponent": word(r"(?<=\d)(?P<x>\.)(?=\d)", "e", NGC, r"^G[01] "),
    "decimal comma": word(r"(?<=\d)(?P<x>\.)(?=\d)", ",", NGC, r"^G[01] "),
    "a spindle speed": digit(r"S(?P<x>[\d.]+)", NGC),
    "the spindle the other way": word(r"^ +(?P<x>M3)\b", "M4", NGC),
    "the spindle left off": dropped(r"^ +(?:S[\d.]+ )?M3\b", NGC),
}

LANGUAGES = {"krl": (KRL, krl_code), "rapid": (RAPID, rapid_code), "gcode": (GCODE, gcode_code)}
