"""A post from another package: installed for real, found, listed, emitted with, and conforming.

Installed by pip into a folder of its own, without network, and used in subprocesses, so that the
running Python never knows it.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]


@pytest.fixture(scope="session")
def plugin(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder into which tests/plugin was installed."""
    folder = tmp_path_factory.mktemp("plugin")
    source, target = folder / "source", folder / "site"
    shutil.copytree(TESTS / "plugin", source)  # a build leaves its traces beside the sources
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
    offline = ["--no-index", "--no-build-isolation", "--no-deps", "--target", str(target)]
    done = subprocess.run([*pip, *offline, str(source)], capture_output=True, text=True)
    assert done.returncode == 0, f"pip could not install the plug-in: {done.stderr}"
    return target


def python(plugin: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(plugin), str(TESTS)])
    return subprocess.run(
        [sys.executable, *arguments],
        env={**os.environ, "PYTHONPATH": path},
        cwd=TESTS.parent,
        capture_output=True,
        text=True,
        timeout=300,
    )


EMIT = """
import json, sys
from output.programs import PORTAL_AXES, emit_of, joint_rivet, named, mixed, pose_program
from drillc.language.diagnostics import Report
from drillc.output.emission import emit_files
from drillc.output.registry import find_posts

report = Report()
[post] = find_posts([named("boreas")], report)
axes = {f"q{i}": f"j{i + 2}" for i in range(1, 7)}
result = {}
for program, emit in [
    (mixed(pose_program, (2, 1, 1)), emit_of("boreas", blend=(12.5, "mm"))),
    (joint_rivet(2), emit_of("boreas", axes, holes_per_module=1.0)),
]:
    for file in emit_files(post, program, emit, report):
        result[file.path] = file.read().decode("ascii")
assert not report.diagnostics, report.diagnostics
json.dump(result, sys.stdout)
"""


def test_it_is_found_and_emits_poses_and_joints(plugin: Path) -> None:
    done = python(plugin, "-c", EMIT)
    assert done.returncode == 0, done.stderr
    files = json.loads(done.stdout)
    assert list(files) == [
        "boreas/PANEL_7L.bor",
        "boreas/PORTAL_A.bor",
        "boreas/PORTAL_A_1.bor",
        "boreas/PORTAL_A_2.bor",
    ]
    poses = files["boreas/PANEL_7L.bor"]
    assert poses.startswith('program PANEL_7L "PANEL_7L" blend 12.5\nroutine drill6 "drill6"\n')
    assert re.findall(r"^run (\w+) at (\w+) depth ([0-9.]+)$", poses, re.MULTILINE) == [
        ("drill6", "P1", "12.000"),
        ("drill6", "P2", "12.250"),
        ("rivet", "P3", "12.500"),
        ("drill6", "P4", "12.750"),
    ]
    assert 'point P2 "P2" 276.500 2335.750 -541.875 [' in poses
    assert files["boreas/PORTAL_A_2.bor"] == (
        'part PORTAL_A_2 2\nregion "plate"\n'
        'axes R2 "R2" J3=57.55000 J4=4946.20000 J5=108.75000 J6=5653.20000 J7=268.80000'
        " J8=2612.20000 out=2211.2000\nrun rivet at R2 depth 12.250\nend part\n"
    )


def test_it_is_listed_with_where_it_comes_from(plugin: Path) -> None:
    script = (
        "from drillc.output.registry import list_posts; from drillc.language.diagnostics import"
        " Report; print([(p.name, p.origin) for p in list_posts(Report())])"
    )
    done = python(plugin, "-c", script)
    assert "('boreas', 'drillc-post-boreas 1.2.0')" in done.stdout, done.stderr
    assert "('gcode', 'drillc " in done.stdout


def test_it_conforms(plugin: Path) -> None:
    """The very suite that drillc's own posts pass, as a plug-in's author would run it."""
    conformance = TESTS / "output" / "test_conformance.py"
    done = python(
        plugin, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(conformance), "-k", "boreas"
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert int(re.search(r"([0-9]+) passed", done.stdout)[1]) > 100  # type: ignore[index]


def test_two_plug_ins_with_one_name_are_refused(plugin: Path, tmp_path: Path) -> None:
    other = tmp_path / "other_post-1.0.dist-info"
    other.mkdir()
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: other-post\nVersion: 1.0\n")
    (other / "entry_points.txt").write_text(
        "[drillc.postprocessors]\nboreas = boreas_post:BoreasPost\n"
    )
    script = (
        f"import sys; sys.path.append({str(tmp_path)!r})\n"
        "from output.programs import named\n"
        "from drillc.language.diagnostics import Report\n"
        "from drillc.output.registry import find_posts\n"
        "report = Report()\n"
        "assert find_posts([named('boreas')], report) == []\n"
        "print(report.diagnostics[0].code, report.diagnostics[0].message)\n"
    )
    done = python(plugin, "-c", script)
    assert done.stdout.startswith("E602 "), done.stdout + done.stderr
    assert "drillc-post-boreas 1.2.0" in done.stdout
    assert "other-post 1.0" in done.stdout


def test_the_running_python_does_not_know_it(plugin: Path) -> None:
    from drillc.language.diagnostics import Report
    from drillc.output.registry import list_posts

    assert "boreas" not in [post.name for post in list_posts(Report())]
