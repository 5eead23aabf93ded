"""What botrail makes of a tool path: run by against_botrail.py in botrail's own interpreter.

Reads {"urdf", "holes": [[standoff, bottom, axis] …] in metres, "spin"} as JSON from its input;
writes the joints at every hole's standoff, before and after drilling, the seconds of processor and
of wall clock that the planning took, the least of three, and botrail's version.
"""

import json
import sys
import time

import botrail


def main() -> None:
    asked = json.load(sys.stdin)
    scene = botrail.Scene(botrail.Robot.from_urdf_string(asked["urdf"]))
    # A move for each target, so that the trajectory says when it is reached.
    moves = []
    for standoff, bottom, axis in asked["holes"]:
        out, deep = ({"position": point, "tool_axis": axis} for point in (standoff, bottom))
        moves.append({"type": "rapid", "targets": [out]})
        moves.append({"type": "feed", "feed": 0.005, "targets": [deep]})
        moves.append({"type": "feed", "feed": 0.05, "targets": [out]})
    scene.add_toolpath("holes", {"moves": moves})
    times = []
    for _ in range(3):
        start, began = time.process_time(), time.perf_counter()
        path = scene.plan_toolpath("holes", spin=asked["spin"])
        times.append((time.process_time() - start, time.perf_counter() - began))
    used, passed = min(times)
    joints = [list(path.sample(moment)) for moment in path.segment_ends]
    if len(joints) != len(moves):
        raise SystemExit(f"{len(moves)} moves, and {len(joints)} ends")
    ends = {"before": joints[0::3], "after": joints[2::3]}
    answer = {**ends, "cpu_s": used, "wall_s": passed, "version": botrail.__version__}
    json.dump(answer, sys.stdout)


if __name__ == "__main__":
    main()
