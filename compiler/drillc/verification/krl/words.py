"""Words of KRL and of the controller that programs run on: types, limits, reserved names."""

from __future__ import annotations

NAME_LENGTH = 24
TEXT_LENGTH = 80
LINE_LENGTH = 470
#: A module is loaded as a whole; some megabytes are all that there is for programs.
MOST_BYTES = 2_000_000

PLACE = ("X", "Y", "Z")
FRAME = (*PLACE, "A", "B", "C")
STATUS = ("S", "T")
ARM_AXES = tuple(f"A{i}" for i in range(1, 7))
EXTERNAL_AXES = tuple(f"E{i}" for i in range(1, 7))
AXES = (*ARM_AXES, *EXTERNAL_AXES)

#: S is three bits, and one that only some controllers set; T has a bit for each of the six axes.
MOST_STATUS, MOST_TURN = 31, 63

#: Components of the controller's own structures.
STRUCTURES: dict[str, tuple[str, ...]] = {
    "FRAME": FRAME,
    "POS": (*FRAME, *STATUS),
    "E3POS": (*FRAME, *STATUS, *EXTERNAL_AXES[:3]),
    "E6POS": (*FRAME, *STATUS, *EXTERNAL_AXES),
    "AXIS": ARM_AXES,
    "E3AXIS": (*ARM_AXES, *EXTERNAL_AXES[:3]),
    "E6AXIS": AXES,
    "LOAD": ("M", "CM", "J"),
    "INERTIA": PLACE,
    "CP": ("CP", "ORI1", "ORI2"),
    "FDAT": ("TOOL_NO", "BASE_NO", "IPO_FRAME", "POINT2", "TQ_STATE"),
    "PDAT": ("VEL", "ACC", "APO_DIST", "APO_MODE", "GEAR_JERK", "EXAX_IGN"),
    "LDAT": (
        *("VEL", "ACC", "APO_DIST", "APO_FAC", "AXIS_VEL", "AXIS_ACC", "ORI_TYP", "CIRC_TYP"),
        *("JERK_FAC", "GEAR_JERK", "EXAX_IGN", "CB"),
    ),
    "CB": ("AUX_PT", "TARGET_PT"),
    "ORI_E_AXIS": ("ORI", *EXTERNAL_AXES),
    "MODULEPARAM_T": ("PARAMS",),
}
#: Types of every controller whose components are not looked at.
OTHER_TYPES = frozenset(
    """
    KRLMSG_T KRLMSGPAR_T KRLMSGOPT_T KRLMSGDLGSK_T KRLMSGPARTYPE_T STATE_T MODUS_T STOPMESS ERROR_T
    CIRC_TYPE ORI_TYPE IPO_MODE IPO_M_T BAS_COMMAND SW_ONOFF TRACE_T DATE FRA ADAP_ACC BRAKE_STATE
    """.split()  # noqa: SIM905 (a table of words)
)
POSITIONS = frozenset({"FRAME", "POS", "E3POS", "E6POS", "AXIS", "E3AXIS", "E6AXIS"})
POSES = frozenset({"FRAME", "POS", "E3POS", "E6POS"})
PLAIN = frozenset({"INT", "REAL", "BOOL", "CHAR"})
#: What may be declared without DECL.
WITHOUT_DECL = PLAIN | POSITIONS

KEYWORDS = frozenset(
    """
    AND ANIN ANOUT BOOL BRAKE B_AND B_EXOR B_NOT B_OR CASE CHAR CIRC CIRC_REL CONFIRM CONST CONTINUE
    C_DIS C_ORI C_PTP C_SPL C_VEL DECL DEF DEFAULT DEFDAT DEFFCT DELAY DIGIN DISTANCE DO ELSE END
    ENDDAT ENDFCT ENDFOR ENDIF ENDLOOP ENDSPLINE ENDSWITCH ENDWHILE ENUM EXIT EXOR EXT EXTFCT FALSE
    FOR GLOBAL GOTO HALT IF IMPORT INTERRUPT INT IS LIN LIN_REL LOOP MAXIMUM MINIMUM NOT
    ON_ERROR_PROCEED OR PRIO PTP PTP_REL PUBLIC PULSE REAL REPEAT RESUME RETURN SCIRC SEC SIGNAL
    SLIN SPLINE SPTP STRUC SWITCH THEN TO TRIGGER TRUE UNTIL WAIT WHEN WHILE WITH
    """.split()  # noqa: SIM905 (a table of words)
)
#: Names of the controller's own data and routines, which no program may declare again.
RESERVED = frozenset(
    """
    BAS IR_STOPM MSGNOTIFY TOOL_DATA BASE_DATA LOAD_DATA TOOL_NAME BASE_NAME P00 BAS_COMMAND
    ABS SIN COS TAN ACOS ATAN2 SQRT INVERSE FORWARD INV_POS VARSTATE
    """.split()  # noqa: SIM905 (a table of words)
)
#: Places and motion parameters in every controller's $config.dat.
PREDEFINED: dict[str, str] = {
    "XHOME": "E6AXIS",
    "FHOME": "FDAT",
    "PDEFAULT": "PDAT",
    "LDEFAULT": "LDAT",
    "PDAT_ACT": "PDAT",
    "FDAT_ACT": "FDAT",
    "LDAT_ACT": "LDAT",
}


def can_be_declared(name: str) -> str:
    """What is wrong with a name (upper case) that a program declares; empty: nothing."""
    if name in KEYWORDS or name in STRUCTURES:
        return "is a word of the language"
    if name in RESERVED:
        return "is a name of the controller's"
    if name.startswith("$"):
        return "begins with $, as only names of the controller do"
    return ""
