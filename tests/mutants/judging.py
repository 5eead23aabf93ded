"""Mutants of emitted programs, read back and proven: which are caught, which survive, and why."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from random import Random

from drillc.testing.emitting import Case, case_of
from mutants.editing import Mutant, mutate
from mutants.faults import LANGUAGES

#: Programs of the corpus that a language's faults are put into: poses, joints, arms; pecks, clamps,
#: dwells, rivets; one file and several.
PROGRAMS = {
    "krl": ("arm_kuka", "poses_peck", "poses_regions", "poses_modules", "portal_drill"),
    "rapid": ("arm_abb", "poses_peck", "poses_regions", "poses_modules", "portal_rivet"),
    "gcode": ("arm_kuka", "portal_drill", "portal_rivet", "portal_modules"),
}


@dataclass
class Tally:
    """`caught` by kind; `survivors` as they came."""

    caught: dict[str, int] = field(default_factory=dict)
    survivors: list[Mutant] = field(default_factory=list)

    @property
    def count(self) -> int:
        return sum(self.caught.values()) + len(self.survivors)


def mutants(language: str, seed: int) -> Iterator[tuple[Case, Mutant]]:
    """Endless: a program, a kind of fault and a place, each at random. Kinds that a program has no
    place for are passed over."""
    rng = Random(f"{language} {seed}")
    kinds, code = LANGUAGES[language]
    cases = [case_of(language, name) for name in PROGRAMS[language]]
    emitted = [case.files() for case in cases]
    while True:
        kind = rng.choice(list(kinds))
        for index in rng.sample(range(len(cases)), len(cases)):
            mutant = mutate(kind, kinds[kind], emitted[index], code, rng)
            if mutant is not None:
                yield cases[index], mutant
                break


def judge(language: str, seed: int, count: int) -> Tally:
    """Prove `count` mutants."""
    tally = Tally()
    for case, mutant in mutants(language, seed):
        if tally.count >= count:
            break
        if case.failures(mutant.files):
            tally.caught[mutant.kind] = tally.caught.get(mutant.kind, 0) + 1
        else:
            tally.survivors.append(mutant)
    return tally


# ── survivors ────────────────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True)
class Equivalent:
    """A fault that changes nothing that the machine does: of a `kind`, in a `place`, where what
    stands `above`, the line itself and what stands `below` it are such, for a reason."""

    why: str
    kind: str
    line: str  # as "before -> after"
    above: str = ""  # the lines above, up to the end
    below: str = ""  # the lines below, from the start
    place: str = ""

    def explains(self, mutant: Mutant) -> bool:
        return bool(
            re.fullmatch(self.kind, mutant.kind)
            and re.search(self.line, f"{mutant.before} -> {mutant.after}", re.DOTALL)
            and re.search(rf"(?:{self.above})\n?\Z", mutant.above, re.DOTALL)
            and re.match(self.below, mutant.below, re.DOTALL)
            and re.search(self.place, mutant.place)
        )


#: How a line may go.
_GONE = "a line of the routine dropped|a line of the routine commented out"
_LINE = rf"{_GONE}|a move of the routine dropped"
_LAST = "the feed stated above is still in force"
_THERE = "in this fault the tool stands where the move leads, as no wait comes after it has moved"
_K_SPINDLE_FAULT = (
    r"spindle_running within[^\n]*\n(?:\$TIMER[^\n]*\n){3}WAIT FOR[^\n]*\n\$TIMER_STOP[^\n]*\n"
    r"IF \$TIMER_FLAG\[16\] THEN\n(?:WAIT SEC 0\n)?(?:\$OUT\[18\]=FALSE[^\n]*\n)?"
)
_R_SPINDLE_FAULT = r"WaitDI di_running[^\n]*\nIF timeout THEN\n(?:SetDO clamp,0;\n)?"
_TARGET = r"CONST robtarget (?!via)"

EQUIVALENT: tuple[Equivalent, ...] = (
    # ── KRL ──────────────────────────────────────────────────────────────────────────────────────
    Equivalent(
        "a turn by 180 deg and one by -180 deg are the same",
        "sign of an angle",
        r"[ABC] (-?)180\.0000\b.* -> .*[ABC] (?!(?:\1)180)-?180\.0000\b",
        place=r"\.dat:",
    ),
    Equivalent(
        "where B is 90 or -90 deg, A and C turn about one axis: only what both come to counts",
        "A and C swapped",
        r"B -90\.0000.* -> .*B -90\.0000",
    ),
    Equivalent(
        "a loop that does nothing never ends: the program stands, and start does not make it go on",
        f"the fault goes on|{_GONE}",
        r"^HALT ",
        r"\nLOOP",
        r"ENDLOOP",
    ),
    Equivalent(
        "whether another peck follows is asked: it does, and does not, at the same depths",
        "digit of a peck",
        r"^WHILE BOTTOM\+5\.000.* -> WHILE BOTTOM\+[4-8]\.",
    ),
    Equivalent(
        "the same, with pecks of 3 mm",
        "digit of a peck",
        r"^WHILE BOTTOM\+3\.000.* -> WHILE BOTTOM\+[2-4]\.",
        place="PECKS",
    ),
    Equivalent(
        _LAST,
        _GONE,
        r"^\$VEL\.CP=0\.050 ->",
        r"\$VEL\.CP=0\.050\b(?:(?!\$VEL).)*",
    ),
    Equivalent(
        _LAST,
        _GONE,
        r"^\$VEL\.CP=0\.090 ->",
        r"\$VEL\.CP=0\.090\b(?:(?!\$VEL).)*",
        place="PECKS",
    ),
    Equivalent(
        "the place is -43.0625: half a digit from both",
        "last digit of a position",
        r"Y -43\.062,.* -> .*Y -43\.063,",
        place="PECKS",
    ),
    Equivalent(_THERE, _LINE, r"^LIN HOLE:STANDOFF", rf"{_K_SPINDLE_FAULT}\$VEL\.CP=0\.050"),
    Equivalent(
        _THERE,
        f"digit of a speed|a speed in mm/s|{_GONE}",
        r"^\$VEL\.CP=0\.050 ->",
        _K_SPINDLE_FAULT,
        r"LIN HOLE:STANDOFF",
    ),
    Equivalent(
        "nothing has moved since the wait above, so there is nothing to be waited for",
        _GONE,
        r"^WAIT SEC 0 ->",
        r"WAIT FOR[^\n]*\n\$TIMER_STOP[^\n]*\nIF \$TIMER_FLAG\[16\] THEN",
    ),
    Equivalent(
        "nothing has moved since the output above was switched, and nothing more is switched",
        _GONE,
        r"^WAIT SEC 0 ->",
        r"\$ANOUT\[1\]=0\.0",
        r"; MsgNotify",
    ),
    Equivalent(
        "the tool is there already",
        "a line of the routine doubled",
        r"^LIN HOLE:(?:AT|STANDOFF\[\d\]) -> ",
    ),
    Equivalent(
        "what is switched already, or set, is so again",
        "a line of the routine doubled",
        r"^\$(?:OUT|ANOUT)\[\d+\]=",
    ),
    Equivalent(
        "the answer has come, and is still there",
        "a line of the routine doubled",
        r"^WAIT FOR \$IN",
    ),
    Equivalent(
        "the tool goes out in one go, at the same speed, instead of in two",
        f"{_LINE}|lines of the routine swapped",
        r"^(?:AT\.Z=-2\.000|LIN HOLE:AT) -> ",
        r"(?:WAIT SEC \d\.\d+|AT\.Z=DEPTH\nLIN HOLE:AT)\n\$VEL\.CP=0\.050(?:\nAT\.Z=-2\.000)?",
        r"(?:LIN HOLE:AT|AT\.Z=-2\.000)?\n?\$VEL\.CP=0\.050\nLIN HOLE:STANDOFF",
    ),
    Equivalent(
        "each part goes home at its start and at its end: between parts one of both will do",
        "home dropped|a line of the routine dropped|a line of the routine commented out",
        r"^PTP \$H_POS ->",
        below=r"END\n",
        place=r"PARTS_[12]\.src",
    ),
    Equivalent(
        "the same, at the start of the next part",
        "home dropped|a line of the routine dropped|a line of the routine commented out",
        r"^PTP \$H_POS ->",
        above=r";ENDFOLD \(INI\)\n",
        place=r"PARTS_[23]\.src",
    ),
    Equivalent(
        "all moves are in the parts, and each of them states and chooses tool and base itself",
        "no (?:tool|base)|wrong (?:tool|base)|digit of the (?:tool|base)",
        r"^(?:BAS\(#(?:TOOL|BASE),1\)|(?:TOOL|BASE)_DATA\[1\]=)",
        place=r"/PARTS\.src",
    ),
    Equivalent(
        "region b and region e have one hole each, to whose standoff the program has gone already",
        f"PTP for LIN|digit of a speed|{_LINE}",
        r"^(?:LIN HOLE:STANDOFF\[2\]|\$VEL\.CP=0\.250) ->",
        r"DEF rivet5\((?:(?!LIN|DEF).)*",
        place=r"REGIONS\.src",
    ),
    Equivalent("the words of a message", "another (?:input|output)", r"^MsgNotify\("),
    # ── RAPID ────────────────────────────────────────────────────────────────────────────────────
    Equivalent(
        "a quaternion and its negative turn alike, and all other parts are 0",
        "sign in a quaternion",
        rf"{_TARGET}\w+:=\[\[[-\d.,]+\],\[(?:0\.0+,)*-?1\.0+(?:,0\.0+)*\],",
    ),
    Equivalent(
        "lines are made with ConfL\\Off, MoveJ to holes with ConfJ\\Off: nothing looks at it",
        "configuration",
        rf"^(?:LOCAL )?{_TARGET}",
    ),
    Equivalent(
        "this part's frame is the world's, in which wobj0 is too",
        "wrong work object|no work object",
        r"\\WObj:=part_frame",
        place="ARM_ABB",
    ),
    Equivalent(
        "whether another peck follows is asked: it does, and does not, at the same depths",
        "digit of a peck",
        r"^WHILE bottom\+5\.000.* -> WHILE bottom\+[4-8]\.",
    ),
    Equivalent(
        "the tool is there already",
        "a line of the routine doubled",
        r"^MoveL RelTool\(hole,",
    ),
    Equivalent(
        "what is switched already, or set, is so again",
        "a line of the routine doubled",
        r"^Set(?:DO|AO) ",
    ),
    Equivalent(
        "the answer has come, and is still there",
        "a line of the routine doubled",
        r"^WaitDI ",
    ),
    Equivalent(
        _THERE,
        f"digit of a speed|a speed in m/s|MoveJ for MoveL|{_LINE}",
        r"^MoveL RelTool\(hole,0,0,standoff\{1\}\)",
        _R_SPINDLE_FAULT,
        r"SetDO do_spindle,0;",
    ),
    Equivalent(
        "region b and region e have one hole each, to whose standoff main has gone already",
        f"MoveJ for MoveL|{_LINE}",
        r"^MoveL RelTool\(hole,0,0,standoff\{2\}\),v100\\V:=250\.000",
        place="REGIONS",
    ),
    Equivalent(
        "the tool goes straight on, at the same speed, and only its stop here is gone",
        f"a zone for fine|{_LINE}",
        r"^MoveL RelTool\(hole,0,0,-2\.000\),v100\\V:=50\.000",
        r"MoveL RelTool\(hole,0,0,depth\)[^\n]*(?:\nWaitTime[^\n]*)?",
        r"MoveL RelTool\(hole,0,0,standoff\{1\}\),v100\\V:=50\.000",
    ),
    Equivalent(
        "the routine for the first hole withdraws the tool and then moves the other axes by itself",
        "a way dropped",
        r"^MoveAbsJ now",
        r"now\.extax\.eax_e:=R1\.extax\.eax_e;",
    ),
    Equivalent(
        "at the end the tool stays where the last hole has left it, out of the part",
        "a way dropped",
        r"^MoveAbsJ now",
        r"rivet5 R3[^\n]*\n[^\n]*\nnow:=CJointT\(\);\n[^\n]*\n[^\n]*",
        r"ENDIF\nENDPROC",
    ),
    # ── G-code ───────────────────────────────────────────────────────────────────────────────────
    Equivalent(
        _LAST,
        "no feed",
        r"^G1 W.* F3000\.000 ->",
        r"F3000\.000(?:(?!F\d).)*",
    ),
    Equivalent(
        _THERE,
        f"no feed|digit of a feed|a feed in mm/s|G0 for G1|{_LINE}",
        r"^G1 W\[#1 - \d+\.0000\] F3000\.000 ->",
        r"M66 P17 [^\n]*\no\d+ if[^\n]*\n(?:M65 P18[^\n]*\n)?",
    ),
    Equivalent(
        "the arm is there already",
        "a hole doubled",
        r"^o<_go> call ",
    ),
    Equivalent(
        "two steps meet at their border: to either of them it may be counted",
        "digit of a place in the routine",
        r"^#6 = FIX\[#5 \+ 0\.000001\]",
        place="arm_kuka",
    ),
    Equivalent(
        "the pecks come out even, so that the last of them ends at the bottom anyway",
        "digit of a place in the routine|another parameter",
        r"^o122 if \[#<bottom> GT \[#2 - 0\.001\]\] -> o122 if \[#<bottom> GT \[#[12] - [0-3]\.",
        place="portal_drill",
    ),
    Equivalent(
        "the axis stands there since the move above",
        "an axis left out",
        r"^G0 .* -> ",
    ),
    Equivalent(
        "where nothing is drilled there is no depth: the routine does not look at it",
        "(?:digit|sign) of an argument|an argument left out",
        r"^o<(rivet5|look)> call (\[\S+\]) \[0\.0000\] -> o<\1> call \2(?: \[|$)",
        place="portal",
    ),
    Equivalent(
        "this is done where U, V and W stand still; here one of them moves each time",
        "another parameter",
        r"^#[456] = #542[678] -> #",
        place="arm_kuka",
    ),
    Equivalent(
        "between two places at which the joints are exact, other steps bend as little",
        "digit of a place in the routine",
        r"^#3 = \[(?:FUP\[#3 -|FIX\[#3 \+) 0\.001\]",
        place="arm_kuka",
    ),
    Equivalent(
        "the bottom is where the last of the joints for this hole is, whatever its depth is called;"
        " other depths shift by less than steps bend",
        "digit of an argument",
        r"^o<(\w+)> call \[(\d+\.\d\d)\d\d\] -> o<\1> call \[\2\d\d\]",
        place="arm_kuka",
    ),
    Equivalent(
        "at the end the tool stays where the last hole has left it, out of the part",
        "a way dropped",
        r"^G0 W0\.0000 ->",
        below=r"\n*M2\n",
    ),
)


def unexplained(survivors: list[Mutant]) -> list[str]:
    """Survivors that nobody has explained."""
    return [
        str(mutant)
        for mutant in survivors
        if not any(reason.explains(mutant) for reason in EQUIVALENT)
    ]
