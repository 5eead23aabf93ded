"""Runs under /usr/bin/python3, where LinuxCNC's `gcode` module lives: `linuxcnc_canon.py FILE`.

Drives LinuxCNC's own interpreter over FILE (from FILE's folder, where it finds subroutine files)
and prints one JSON object: the moves in order, and why it stopped. Not imported by tests.
"""

import json
import os
import sys
import tempfile

import gcode

INCH = 25.4
EMPTY_TOOL = (-1,) + (0.0,) * 12 + (0,)


class Canon:
    """What the interpreter calls. Lengths arrive in inches, angles in degrees."""

    def __init__(self, folder):
        self.parameter_file = os.path.join(folder, "parameters.var")
        open(self.parameter_file, "w").close()
        self.moves = []
        self.messages = []
        self.others = []
        self.comments = []
        self.feed_rate = None
        self.line = 0
        self.g5x = (0.0,) * 9
        self.g92 = (0.0,) * 9
        self.offset = (0.0,) * 9

    def next_line(self, state):
        self.line = state.sequence_number

    def comment(self, text):
        if not text.startswith("interpreter:"):
            self.comments.append(text)

    def message(self, text):
        self.messages.append(text)

    def set_feed_rate(self, rate):
        self.feed_rate = rate * INCH  # of a length; an angle's comes multiplied likewise

    def straight_traverse(self, *place):
        self._move("traverse", place)

    def straight_feed(self, *place):
        self._move("feed", place)

    def arc_feed(self, *place):
        self.others.append("arc_feed")

    def dwell(self, seconds):
        self.moves.append(
            {"kind": "dwell", "seconds": seconds, "line": self.line, "comments": self._taken()}
        )

    def set_g5x_offset(self, index, *offset):
        self.g5x = offset

    def set_g92_offset(self, *offset):
        self.g92 = offset

    def tool_offset(self, *offset):
        self.offset = offset

    def set_xy_rotation(self, angle):
        if angle:
            self.others.append("rotation")

    def _move(self, kind, place):
        for offset in (self.g5x, self.g92, self.offset):
            if any(offset):
                self.others.append(f"offset {offset}")
        place = [p * INCH if i not in (3, 4, 5) else p for i, p in enumerate(place)]
        self.moves.append(
            {
                "kind": kind,
                "place": dict(zip("XYZABCUVW", place, strict=True)),
                "feed": self.feed_rate if kind == "feed" else None,
                "line": self.line,
                "comments": self._taken(),
            }
        )

    def _taken(self):
        taken, self.comments = self.comments, []
        return taken

    def check_abort(self):
        return False

    def get_tool(self, index):
        return EMPTY_TOOL

    def get_external_angular_units(self):
        return 1.0

    def get_external_length_units(self):
        return 1.0

    def get_axis_mask(self):
        return 0x1FF

    def get_block_delete(self):
        return False

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *arguments: self.others.append(name)


def main(path):
    os.chdir(os.path.dirname(os.path.abspath(path)))
    with tempfile.TemporaryDirectory() as folder:
        canon = Canon(folder)
        result, line = gcode.parse(os.path.basename(path), canon, "", "")
    error = None
    if result > gcode.MIN_ERROR:
        error = f"line {line}: {gcode.strerror(result)}"
    json.dump(
        {
            "error": error,
            "moves": canon.moves,
            "messages": canon.messages,
            "others": sorted(set(canon.others)),
            "trailing_comments": canon.comments,
        },
        sys.stdout,
    )


main(sys.argv[1])
